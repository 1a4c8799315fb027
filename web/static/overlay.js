// Overlays of the live view.
