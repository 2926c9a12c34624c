"""Find out where photographs were taken, from a flight log.

Photographs and the log's triggers are matched by time and place, so that a camera's wrong clock and missing photographs
do no harm. On the command line: `fieldkit geotag flight_7/ --log flight_7.tlog -o flight_7/poses.csv`.
"""

# %%
import tempfile
from datetime import UTC, datetime
from pathlib import Path

from PIL import Image

import fieldkit
from fieldkit.flightlogs import read_flight_log
from fieldkit.flightlogs.geotag import geotag

folder = Path(tempfile.mkdtemp(prefix="fieldkit-"))

# %% [markdown]
# A flight of ArduCopter that was recorded with its simulator. Its camera was simulated, too, so photographs are made up
# here: grey ones, with the time of the trigger on a clock that is 40 s fast. One of them is lost.

# %%
log = Path(fieldkit.__file__).parents[1] / "sim" / "sitl" / "mount_then_yaw.tlog"
flight = read_flight_log(log)
print(f"{len(flight.triggers)} triggers")
(folder / "flight_7").mkdir()
for number, trigger in enumerate(flight.triggers):
    taken = datetime.fromtimestamp(trigger.utc_s + 40.0, UTC)
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0x9003] = taken.strftime("%Y:%m:%d %H:%M:%S")
    exif.get_ifd(0x8769)[0x9291] = f"{taken.microsecond // 1000:03d}"
    if number != 3:
        grey = Image.new("RGB", (64, 48), (number, 128, 128))
        grey.save(folder / "flight_7" / f"DSC{number:03d}.jpg", exif=exif)

# %%
report = geotag(folder / "flight_7", log, folder / "flight_7" / "poses.csv")
print(f"{len(report.poses)} of {report.images} photographs have a pose; the camera's clock is "
      f"{report.matches.offset_s:.1f} s fast")  # fmt: skip
print((folder / "flight_7" / "poses.csv").read_text().splitlines()[0])
