"""The message for a command that needs a package which `pip install ./lme`, the robots' installation, leaves out."""

from __future__ import annotations

PACKAGES = {  # by the module that is imported
    "hydra": "hydra-core",
    "jinja2": "jinja2",
    "matplotlib": "matplotlib",
    "mlflow": "mlflow",
    "onnx": "onnx",
    "onnxruntime": "onnxruntime",
    "optuna": "optuna",
    "packaging": "packaging",
    "pandas": "pandas",
    "pyarrow": "pyarrow",
    "rich": "rich",
}


def explain_missing(error: ModuleNotFoundError, command: str) -> str:
    """Return what is missing and how to install it; empty for a module that every installation has, or for none."""
    package = PACKAGES.get((error.name or "").partition(".")[0])
    if package is None:
        return ""
    install = "pip install './lme[live]'" if command == "live" else "pip install --editable ."
    return f"needs {package}, which is not installed; {install} in a checkout of lme installs what lme {command} needs"
