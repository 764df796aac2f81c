"""What bends the true arm, in the report and in the recording: maps of joints, sag, motion."""
