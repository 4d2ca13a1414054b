"""Every benchmark of sliding friction: ``python -m benchmarks.friction [FOLDER]``.

Tables go to stdout, figures to the folder; it takes about five minutes on one core. The kernels themselves are timed by
``pytest benchmarks/bench_friction.py benchmarks/bench_materials.py --benchmark-enable``.
"""

import sys
from pathlib import Path

from benchmarks import (
    honesty_bodies,
    honesty_friction,
    law_indenter_friction,
    work_precision_campaign,
    work_precision_friction,
)


def main(folder="figures"):
    Path(folder).mkdir(parents=True, exist_ok=True)
    print("# Error against time of a solution")
    work_precision_friction.main(f"{folder}/work_precision_friction.png")
    print("\n# Error against core-seconds of a campaign")
    work_precision_campaign.main(f"{folder}/work_precision_campaign.png")
    print("\n# Honesty of the error estimate")
    honesty_friction.main()
    honesty_bodies.main()
    print("\n# Rough indenters against law 3.40")
    law_indenter_friction.main()


if __name__ == "__main__":
    main(*sys.argv[1:])
