"""Rooms from files of other programs: maps of ROS, worlds of Gazebo and Stage, drawings as DXF, SVG and GeoJSON."""

REFLECTANCE = 0.9  # of a surface of unknown material
