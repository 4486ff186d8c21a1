"""For catkin alone, which calls it: use cmake, catkin_make or catkin_make_isolated, not this
file.
"""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import find_packages, setup

# src/ also holds the stand-ins for smach, smach_ros, smach_msgs and control_msgs: CMake installs
# those where upstream is absent. smach_common is what they share with smach_oracle
setup(
    **generate_distutils_setup(
        packages=find_packages(
            'src',
            include=['smach_common', 'smach_common.*', 'smach_oracle', 'smach_oracle.*'],
        ),
        package_dir={'': 'src'},
        package_data={
            '': ['*.yaml', 'templates/*.*', 'static/*.*', 'static/*/*.*', 'static/js/*/*.*']
        },
    )
)
