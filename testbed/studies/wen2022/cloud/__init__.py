"""The clouds of Figure 7: the tool point at the zero pose, drawn again from both budgets."""
