"""Networks: what reads or writes shapes by learned weights. Each file is one network with its frozen config."""
