"""Where readings come from: synthetic scenes, logged flights, recorded films. All of them are a `field.Field`."""
