"""MAVLink 2: frames, links, readings and the mission protocol. The only package that imports pymavlink."""
