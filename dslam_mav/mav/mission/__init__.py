"""The mission protocol: both ends of it as pure state machines, and the transfers a ground station makes with it."""
