"""Programs of robots as joints: RAPID, KRL, TP and URScript."""
