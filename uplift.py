"""Uplift: the seismic response of plates and shells on compression-only supports."""

from pathlib import Path

_here = Path(__file__).parent
# In a checkout the folder of this file holds the rooms; installed, the folder `uplift` beside it does.
__path__ = [str(_here / "uplift" if (_here / "uplift").is_dir() else _here)]
