# MuJoCo's bindings are compiled and ship no stubs: to the type checker their names are Any.
from typing import Any

def __getattr__(name: str) -> Any: ...
