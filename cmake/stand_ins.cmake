# Stage smach, smach_ros, smach_msgs and control_msgs where upstream's are absent, each judged on
# its own. Where upstream's package is there, nothing of ours gets in front of it, and what an
# earlier build staged is taken away again.
#
# Include after generate_messages(), which defines GENMSG_PY_BIN (from genpy) and MSG_I_FLAGS, and
# catkin_package(). GENACTION_BIN is from actionlib_msgs.

set(STAND_IN_MARKER .${PROJECT_NAME}_stand_in)
set(STAND_IN_FIND ${CMAKE_CURRENT_LIST_DIR}/find_upstream.py)
set(STAND_IN_RELAY ${CMAKE_CURRENT_LIST_DIR}/relay_init.py.in)
set(STAND_IN_MANIFEST ${CMAKE_CURRENT_LIST_DIR}/stand_in_package.xml.in)
set(STAND_IN_DEVEL_PYTHON ${CATKIN_DEVEL_PREFIX}/${CATKIN_GLOBAL_PYTHON_DESTINATION})

# stand_in_find_upstream(NAME RESULT): where upstream's NAME is, or an empty string
function(stand_in_find_upstream name result)
  # CATKIN_ORDERED_PACKAGES: the packages that a catkin_make workspace builds beside this one
  list(FIND CATKIN_ORDERED_PACKAGES ${name} index)
  if(NOT index EQUAL -1)
    set(${result} "this workspace" PARENT_SCOPE)
    return()
  endif()
  set(folders)
  foreach(workspace ${CATKIN_WORKSPACES})
    list(APPEND folders ${workspace}/${CATKIN_GLOBAL_PYTHON_DESTINATION})
  endforeach()
  execute_process(COMMAND ${PYTHON_EXECUTABLE} ${STAND_IN_FIND} ${name} ${folders}
    OUTPUT_VARIABLE found OUTPUT_STRIP_TRAILING_WHITESPACE RESULT_VARIABLE failed)
  if(failed)
    message(FATAL_ERROR
      "${PYTHON_EXECUTABLE} cannot look for the Python package '${name}': ${failed}")
  endif()
  set(${result} "${found}" PARENT_SCOPE)
endfunction()

# stand_in_relay(NAME): the devel space's NAME/__init__.py, which runs the one in src/
function(stand_in_relay name)
  set(RELAY_SOURCE ${CMAKE_CURRENT_SOURCE_DIR}/src/${name})
  configure_file(${STAND_IN_RELAY} ${STAND_IN_DEVEL_PYTHON}/${name}/__init__.py @ONLY)
endfunction()

# stand_in_remove(NAME): take away what an earlier configure or install staged, and only that
function(stand_in_remove name)
  set(package ${STAND_IN_DEVEL_PYTHON}/${name})
  if(EXISTS ${package}/${STAND_IN_MARKER})
    # an upstream in this same workspace may have written here already, before its turn came to us
    file(READ ${package}/__init__.py init)
    if(NOT init OR init MATCHES "Relays from the devel space")
      file(REMOVE_RECURSE ${package})
    endif()
    file(REMOVE ${package}/${STAND_IN_MARKER} ${CATKIN_DEVEL_PREFIX}/share/${name}/package.xml)
    file(REMOVE_RECURSE
      ${CATKIN_DEVEL_PREFIX}/share/${name}/msg ${CATKIN_DEVEL_PREFIX}/share/${name}/action)
  endif()
  install(CODE "
    set(prefix \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}\")
    set(package \"\${prefix}/${CATKIN_GLOBAL_PYTHON_DESTINATION}/${name}\")
    if(EXISTS \"\${package}/${STAND_IN_MARKER}\")
      file(REMOVE_RECURSE \"\${package}\" \"\${prefix}/${CATKIN_GLOBAL_SHARE_DESTINATION}/${name}\")
    endif()")
endfunction()

# stand_in_add(NAME DEPENDS...): stage and install the package and its manifest
function(stand_in_add name)
  set(package ${STAND_IN_DEVEL_PYTHON}/${name})
  if(EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/src/${name}/__init__.py)
    stand_in_relay(${name})
    install(DIRECTORY src/${name}/ DESTINATION ${CATKIN_GLOBAL_PYTHON_DESTINATION}/${name}
      FILES_MATCHING PATTERN "*.py" PATTERN "__pycache__" EXCLUDE)
  else()
    # all generated: an __init__.py in src/ would hide the generated classes from whoever has src/
    # first in the path
    file(WRITE ${package}/__init__.py "")
    install(FILES ${package}/__init__.py DESTINATION ${CATKIN_GLOBAL_PYTHON_DESTINATION}/${name})
  endif()
  file(WRITE ${package}/${STAND_IN_MARKER} "staged by ${PROJECT_NAME} ${${PROJECT_NAME}_VERSION}\n")
  install(FILES ${package}/${STAND_IN_MARKER}
    DESTINATION ${CATKIN_GLOBAL_PYTHON_DESTINATION}/${name})
  set(STAND_IN_NAME ${name})
  set(STAND_IN_DEPENDS)
  foreach(dependency ${ARGN})
    set(STAND_IN_DEPENDS "${STAND_IN_DEPENDS}  <exec_depend>${dependency}</exec_depend>\n")
  endforeach()
  configure_file(${STAND_IN_MANIFEST} ${CATKIN_DEVEL_PREFIX}/share/${name}/package.xml @ONLY)
  install(FILES ${CATKIN_DEVEL_PREFIX}/share/${name}/package.xml
    DESTINATION ${CATKIN_GLOBAL_SHARE_DESTINATION}/${name})
endfunction()

# stand_in_collect_messages(NAME): put the messages of src/NAME/msg, and those that src/NAME/action
# means, into the devel space, where rosmsg finds them
function(stand_in_collect_messages name)
  set(source ${CMAKE_CURRENT_SOURCE_DIR}/src/${name})
  set(share ${CATKIN_DEVEL_PREFIX}/share/${name})
  file(REMOVE_RECURSE ${share}/msg ${share}/action)
  file(GLOB messages ${source}/msg/*.msg)
  file(COPY ${messages} DESTINATION ${share}/msg)
  file(GLOB actions ${source}/action/*.action)
  foreach(action ${actions})
    file(COPY ${action} DESTINATION ${share}/action)
    execute_process(
      COMMAND ${CATKIN_ENV} ${PYTHON_EXECUTABLE} ${GENACTION_BIN} ${action} -o ${share}/msg
      RESULT_VARIABLE failed)
    if(failed)
      message(FATAL_ERROR "${GENACTION_BIN} cannot make messages of ${action}: ${failed}")
    endif()
  endforeach()
  # a later change to one of them has CMake run again
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${messages} ${actions})
  install(DIRECTORY ${share}/msg DESTINATION ${CATKIN_GLOBAL_SHARE_DESTINATION}/${name})
  if(actions)
    install(DIRECTORY ${share}/action DESTINATION ${CATKIN_GLOBAL_SHARE_DESTINATION}/${name})
  endif()
endfunction()

# stand_in_messages(NAME): generate the Python classes of NAME's messages under the package's name
function(stand_in_messages name)
  stand_in_collect_messages(${name})
  set(source ${CATKIN_DEVEL_PREFIX}/share/${name}/msg)
  set(python ${STAND_IN_DEVEL_PYTHON}/${name}/msg)
  set(classes)
  file(GLOB messages ${source}/*.msg)
  foreach(message ${messages})
    get_filename_component(type ${message} NAME_WE)
    add_custom_command(OUTPUT ${python}/_${type}.py DEPENDS ${GENMSG_PY_BIN} ${message}
      COMMAND ${CATKIN_ENV} ${PYTHON_EXECUTABLE} ${GENMSG_PY_BIN} ${message}
              -I${name}:${source} ${MSG_I_FLAGS} -p ${name} -o ${python}
      COMMENT "Generating Python from MSG ${name}/${type}")
    list(APPEND classes ${python}/_${type}.py)
  endforeach()
  add_custom_command(OUTPUT ${python}/__init__.py DEPENDS ${GENMSG_PY_BIN} ${classes}
    COMMAND ${CATKIN_ENV} ${PYTHON_EXECUTABLE} ${GENMSG_PY_BIN} -o ${python} --initpy
    COMMENT "Generating Python msg __init__.py for ${name}")
  add_custom_target(${PROJECT_NAME}_${name} ALL DEPENDS ${classes} ${python}/__init__.py)
  install(DIRECTORY ${python} DESTINATION ${CATKIN_GLOBAL_PYTHON_DESTINATION}/${name}
    PATTERN "__pycache__" EXCLUDE)
endfunction()

set(STAND_INS)
set(control_msgs_depends actionlib_msgs geometry_msgs std_msgs trajectory_msgs)
set(smach_depends)
set(smach_msgs_depends std_msgs)
set(smach_ros_depends actionlib rospy smach smach_msgs)
foreach(name control_msgs smach smach_msgs smach_ros)
  stand_in_find_upstream(${name} upstream)
  if(upstream)
    message(STATUS "${name}: upstream's is used, from ${upstream}")
    stand_in_remove(${name})
  else()
    message(STATUS "${name}: upstream's is absent, ours stands in")
    stand_in_add(${name} ${${name}_depends})
    list(APPEND STAND_INS ${name})
    if(name MATCHES "_msgs$")
      stand_in_messages(${name})
    endif()
  endif()
endforeach()

if(STAND_INS)
  catkin_add_env_hooks(50.stand_ins SHELLS sh SKIP_INSTALL
    DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR}/env-hooks)
else()
  file(REMOVE ${CATKIN_DEVEL_PREFIX}/etc/catkin/profile.d/50.stand_ins.sh)
endif()

set(SMACH_STAND_INS ${STAND_INS})
list(REMOVE_ITEM SMACH_STAND_INS control_msgs)
list(LENGTH SMACH_STAND_INS count)
if(count GREATER 0 AND count LESS 3)
  message(WARNING
    "Upstream's smach, smach_msgs and smach_ros are only partly there. Ours stand in for "
    "${SMACH_STAND_INS}, beside upstream's others. "
    "Install the missing ones if you did not mean that.")
endif()
