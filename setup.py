"""Everything is in pyproject.toml but for the examples, which `tango init` copies and which live beside the package."""

from setuptools import find_packages, setup

setup(
    packages=[*find_packages(include=["tango_cnc*", "postprocessors*", "sim_controller*"]), "tango_cnc.examples"],
    package_dir={"tango_cnc.examples": "examples"},
    package_data={
        "tango_cnc": [
            "py.typed",
            "reproduce/*.yaml",
            "link/*.yaml",
            "texts/*",
            "report/templates/*",
            "web/templates/*",
            "web/static/*",
        ],
        "tango_cnc.examples": ["**/*"],
        "sim_controller": ["controls/*.yaml"],
    },
)
