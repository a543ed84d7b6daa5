"""Files that describe robots: URDF, xacro, MJCF and SRDF."""
