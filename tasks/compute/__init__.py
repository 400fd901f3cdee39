"""Where units run: in this process or on the workers of a cluster, through the loss of some of them."""
