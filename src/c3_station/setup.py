"""Install the package with colcon; package.xml names what it depends on."""

from setuptools import find_packages, setup

package_name = 'c3_station'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['py.typed', '*.xml', 'scenarios/*.yaml', 'templates/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    python_requires='>=3.11',
    install_requires=['setuptools'],
    extras_require={'dask': ['distributed'], 'test': ['hypothesis', 'pytest']},
    zip_safe=False,
    maintainer='Shearwater developers',
    maintainer_email='shearwater@example.org',
    description='Shore station of Shearwater: scenarios, C3 agent, recorder, reports',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'c3 = c3_station.c3_node:main',
            'recorder = c3_station.recorder_node:main',
        ],
    },
)
