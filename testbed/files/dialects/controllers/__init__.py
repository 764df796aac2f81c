"""Programs of robots as joints: RAPID, KRL, TP, URScript, DRL, AS, INFORM, VAL3 and RL."""
