"""What measurements can tell: rank, redundancies, observability indices, propagation."""
