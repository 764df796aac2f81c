"""Who plays the pieces of a study: this process, others of this machine, a cluster."""
