"""What several tests share of link same parameters."""

import json
import re

from support.runs import Result
from support.simulated_runs import controller
from tango_cnc.commands.init import write_example

SIGMAS = 6.0  # of the estimate itself: without noise its residuals are what the control's resolution leaves


def estimate(folder, name):
    result = Result("estimate", "-C", folder, "--readings", folder / name, "--json", "-")
    assert result.code == 0, result.err
    return json.loads(result.out)


def the_same_parameters(folder, link, options, port, example="hu40t"):
    write_example(folder, example)
    world = (folder / "world.yaml").read_text()
    (folder / "world.yaml").write_text(re.sub(r"noise: .*", "noise: 0.0", world))
    with controller(folder, *options, once=False) as url:
        result = Result("run", "-C", folder, "--port", port.format(url), "--timeout", "60")
    assert result.code == 0, result.err
    assert Result("simulate", "-C", folder, "-o", folder / "simulated.csv").code == 0
    true, got = estimate(folder, "simulated.csv"), estimate(folder, "readings.csv")
    assert got["terms"] == true["terms"]
    assert got["residual"]["rms_um"] < 1.0
    away = {
        name: abs(parameter["value"] - true["parameters"][name]["value"]) / max(parameter["std"], 1e-12)
        for name, parameter in got["parameters"].items()
    }
    print(
        f"\n{link}: residual {got['residual']['rms_um']:.3f} µm rms, parameters within {max(away.values()):.1f} standard deviations"
    )
    assert max(away.values()) < SIGMAS
