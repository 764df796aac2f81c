"""Programs of robots as joints: RAPID, KRL, TP, URScript, DRL, AS, INFORM and VAL3."""
