"""Where a calibration's statement applies: the region it was proven in, held-out poses, targets."""
