"""The biases of a sensor from aircraft that report their own positions: `radarsim register`."""
