"""The loopback vehicle from within: its sockets, its autopilot, its flight. `sim_bridge.vehicle` is its face."""
