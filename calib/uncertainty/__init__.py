"""How uncertain the identified numbers and the tool point are."""
