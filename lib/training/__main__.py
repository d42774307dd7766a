"""Train a network:   python -m lib.training NAME [options]       (python -m lib.training NAME --help lists them)

On several processes or GPUs:   fabric run --devices 2 lib/training/__main__.py NAME [options]
"""

import sys

from lib.training import (  # absolute: for `fabric run`
    csgnet_command,
    program_vae_command,
    reinforce_command,
    stump_net_command,
    ucsg_command,
)
from lib.training.commands import main

COMMANDS = {
    "program_vae": program_vae_command.COMMAND,
    "csgnet": csgnet_command.COMMAND,
    "csgnet_reinforce": reinforce_command.COMMAND,
    "stump_net": stump_net_command.COMMAND,
    "ucsg": ucsg_command.COMMAND,
}

if __name__ == "__main__":
    sys.exit(main(COMMANDS))
