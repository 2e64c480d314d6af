"""Install the package with colcon; package.xml names what it depends on."""

from setuptools import find_packages, setup

package_name = 'auv_sim'

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
    description='AUV agent, AUV node and drivers, and the simulated world of Shearwater',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'auv = auv_sim.auv_node:main',
            'fleet = auv_sim.fleet_node:main',
            'world = auv_sim.world_node:main',
        ],
        'auv_sim.drivers': [
            'kinematic = auv_sim.drivers.kinematic:make_driver',
            'topics = auv_sim.drivers.topics:make_driver',
        ],
    },
)
