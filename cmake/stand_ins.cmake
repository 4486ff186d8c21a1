# Stage smach, smach_ros, smach_msgs and control_msgs, each under a prefix of its own in
# share/smach_oracle/stand_ins. The hook 50.stand_ins puts those on the paths whose upstream package
# is absent, whenever an environment is set up. So upstream's may come and go without a new build,
# and no file of ours is where upstream's belongs.
#
# Include after generate_messages(), which defines GENMSG_PY_BIN (from genpy) and MSG_I_FLAGS, and
# catkin_package(). GENACTION_BIN is from actionlib_msgs.

set(STAND_IN_MARKER .${PROJECT_NAME}_stand_in)
set(STAND_IN_RELAY ${CMAKE_CURRENT_LIST_DIR}/relay_init.py.in)
set(STAND_IN_MANIFEST ${CMAKE_CURRENT_LIST_DIR}/stand_in_package.xml.in)
set(STAND_IN_PREFIX ${CATKIN_PACKAGE_SHARE_DESTINATION}/stand_ins)
set(STAND_IN_DEVEL ${CATKIN_DEVEL_PREFIX}/${STAND_IN_PREFIX})

# stand_in_relay(NAME FOLDER): FOLDER/NAME/__init__.py, which runs the one in src/
function(stand_in_relay name folder)
  set(RELAY_SOURCE ${CMAKE_CURRENT_SOURCE_DIR}/src/${name})
  configure_file(${STAND_IN_RELAY} ${folder}/${name}/__init__.py @ONLY)
endfunction()

# stand_in_remove_old(NAME): take away what release 0.1 staged and installed among upstream's, and
# only that
function(stand_in_remove_old name)
  set(package ${CATKIN_DEVEL_PREFIX}/${CATKIN_GLOBAL_PYTHON_DESTINATION}/${name})
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
  set(package ${STAND_IN_DEVEL}/${name}/python/${name})
  if(EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/src/${name}/__init__.py)
    stand_in_relay(${name} ${STAND_IN_DEVEL}/${name}/python)
    install(DIRECTORY src/${name}/ DESTINATION ${STAND_IN_PREFIX}/${name}/python/${name}
      FILES_MATCHING PATTERN "*.py" PATTERN "__pycache__" EXCLUDE)
  else()
    # all generated: an __init__.py in src/ would hide the generated classes from whoever has src/
    # first in the path
    file(WRITE ${package}/__init__.py "")
    install(FILES ${package}/__init__.py DESTINATION ${STAND_IN_PREFIX}/${name}/python/${name})
  endif()
  file(WRITE ${package}/${STAND_IN_MARKER} "staged by ${PROJECT_NAME} ${${PROJECT_NAME}_VERSION}\n")
  install(FILES ${package}/${STAND_IN_MARKER}
    DESTINATION ${STAND_IN_PREFIX}/${name}/python/${name})
  set(STAND_IN_NAME ${name})
  set(STAND_IN_DEPENDS)
  foreach(dependency ${ARGN})
    set(STAND_IN_DEPENDS "${STAND_IN_DEPENDS}  <exec_depend>${dependency}</exec_depend>\n")
  endforeach()
  set(share ${name}/share/${name})
  configure_file(${STAND_IN_MANIFEST} ${STAND_IN_DEVEL}/${share}/package.xml @ONLY)
  install(FILES ${STAND_IN_DEVEL}/${share}/package.xml DESTINATION ${STAND_IN_PREFIX}/${share})
endfunction()

# stand_in_collect_messages(NAME): put the messages of src/NAME/msg, and those that src/NAME/action
# means, into the devel space, where rosmsg finds them
function(stand_in_collect_messages name)
  set(source ${CMAKE_CURRENT_SOURCE_DIR}/src/${name})
  set(share ${STAND_IN_DEVEL}/${name}/share/${name})
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
  install(DIRECTORY ${share}/msg DESTINATION ${STAND_IN_PREFIX}/${name}/share/${name})
  if(actions)
    install(DIRECTORY ${share}/action DESTINATION ${STAND_IN_PREFIX}/${name}/share/${name})
  endif()
endfunction()

# stand_in_messages(NAME): generate the Python classes of NAME's messages under the package's name
function(stand_in_messages name)
  stand_in_collect_messages(${name})
  set(source ${STAND_IN_DEVEL}/${name}/share/${name}/msg)
  set(python ${STAND_IN_DEVEL}/${name}/python/${name}/msg)
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
  install(DIRECTORY ${python} DESTINATION ${STAND_IN_PREFIX}/${name}/python/${name}
    PATTERN "__pycache__" EXCLUDE)
endfunction()

set(control_msgs_depends actionlib_msgs geometry_msgs std_msgs trajectory_msgs)
set(smach_depends)
set(smach_msgs_depends std_msgs)
set(smach_ros_depends actionlib rospy smach smach_msgs)
foreach(name control_msgs smach smach_msgs smach_ros)
  stand_in_remove_old(${name})
  stand_in_add(${name} ${${name}_depends})
  if(name MATCHES "_msgs$")
    stand_in_messages(${name})
  endif()
endforeach()

configure_file(${CMAKE_CURRENT_LIST_DIR}/stand_in_paths.py ${STAND_IN_DEVEL}/paths.py COPYONLY)
install(FILES ${CMAKE_CURRENT_LIST_DIR}/stand_in_paths.py DESTINATION ${STAND_IN_PREFIX}
  RENAME paths.py)
catkin_add_env_hooks(50.stand_ins SHELLS sh DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR}/env-hooks)
