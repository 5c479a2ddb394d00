"""The scripts in integrations/, which are on no path, as modules."""

import importlib.util
import sys

from tests.places import ROOT

SCRIPTS = sorted((ROOT / "integrations").rglob("*.py"))


def load(name):
    """The module of the script NAME.py. It finds the scripts next to it."""
    if name in sys.modules:
        return sys.modules[name]
    (path,) = (path for path in SCRIPTS if path.stem == name)
    spec = importlib.util.spec_from_file_location(name, path)
    sys.modules[name] = module = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(path.parent))
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    finally:
        sys.path.remove(str(path.parent))
    return module
