"""What rows say beside joints and readings, and what is made of it: order, torques, gears."""
