"""Install the package with colcon; package.xml names what it depends on."""

from setuptools import find_packages, setup

package_name = 'uav_planner'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    python_requires='>=3.11',
    install_requires=['setuptools'],
    extras_require={'test': ['hypothesis', 'pytest']},
    zip_safe=False,
    maintainer='Shearwater developers',
    maintainer_email='shearwater@example.org',
    description='Sortie planners, UAV agent, UAV node and UAV drivers of Shearwater',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'uav = uav_planner.uav_node:main',
        ],
        'uav_planner.drivers': [
            'kinematic = uav_planner.drivers.kinematic:make_driver',
            'topics = uav_planner.drivers.topics:make_driver',
        ],
    },
)
