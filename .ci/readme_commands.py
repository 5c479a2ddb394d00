"""Print the commands of the README's section "Two commands", one a line, word for word."""

import re
from pathlib import Path

page = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
section = page.partition("\n## Two commands\n")[2].partition("\n## ")[0]
block = re.search(r"^```sh\n(.*?)^```$", section, re.DOTALL | re.MULTILINE)
commands = [line for line in block[1].splitlines() if line and not line.startswith("#")] if block else []
if len(commands) != 2:
    raise SystemExit(f'README.md: the section "Two commands" has {len(commands)} commands')
print("\n".join(commands))
