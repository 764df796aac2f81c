"""What measurements can determine: rank, redundancies, observability indices, propagation."""
