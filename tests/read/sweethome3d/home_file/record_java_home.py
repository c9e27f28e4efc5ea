"""Records java_home.bin: the entry `Home` as Sweet Home 3D writes it for JAVA_HOME_XML.

Run by hand, with a JDK and the example homes' package: `python -m
tests.read.sweethome3d.home_file.record_java_home`. Effects: runs javac and java, writes java_home.bin.
"""

from __future__ import annotations

import io
import subprocess
import tempfile
import zipfile
from pathlib import Path

from pbrs_farm.assets import homes_package
from tests.read.sweethome3d.sh3d_source import BOX_OBJ, ROOM, WALLS, home_xml, sh3d

RECORD = Path(__file__).with_name("java_home.bin")
JAVA_HOME_XML = home_xml(
    """
<property name='Author' value='&#201;va &#128512;'/>
<observerCamera attribute='storedCamera' name='Door' x='100' y='120' z='160' yaw='0.5' pitch='0.1'
  fieldOfView='1.1'/>
<level id='low' name='Ground' elevation='0' floorThickness='12' height='250'/>
<level id='high' name='Attic' elevation='262' floorThickness='12' height='200' visible='false'/>
<pieceOfFurniture level='low' catalogId='x#chair' name='Chair' model='1/chair.obj' x='150' y='100'
  angle='1.5707964' width='50' depth='40' height='90' modelMirrored='true' color='FF112233'
  modelRotation='0 0 1 0 1 0 -1 0 0'>
 <material name='wood' color='FF445566' shininess='0.25'/>
</pieceOfFurniture>
<furnitureGroup level='low' name='Set' x='200' y='200' width='100' depth='100' height='80'>
 <pieceOfFurniture name='Box' model='1/chair.obj' level='low' x='200' y='200' elevation='12.3'
  width='60' depth='30' height='80' pitch='0.2'/>
</furnitureGroup>
<doorOrWindow level='low' name='Door' model='1/chair.obj' x='200' y='0' width='90' depth='15'
  height='205' wallThickness='0.5' wallDistance='0.25' wallWidth='0.9' wallLeft='0.05'
  wallHeight='0.95' wallTop='0.01' cutOutShape='M0,0 v1 h1 v-1 z'/>
<light level='low' name='Lamp' model='1/chair.obj' x='100' y='200' elevation='180' width='30'
  depth='30' height='40' power='0.7'>
 <lightSource x='0.5' y='0.5' z='0.25' color='FFFFEE' diameter='0.2'/>
</light>
"""
    + WALLS.replace("<wall ", "<wall level='low' ").replace(
        "yEnd='0' thickness='10'/>\n<wall level='low' id='b'",
        "yEnd='0' thickness='10' arcExtent='0.4' heightAtEnd='200' leftSideColor='FFAA0011'"
        " leftSideShininess='0.5'><baseboard attribute='leftSideBaseboard' thickness='1' height='7'"
        " color='FF00FF00'/></wall>\n<wall level='low' id='b'",
    )
    + ROOM.replace("<room ", "<room level='low' floorColor='FFC8C8C8' ceilingVisible='false' "),
    room="",
)
CONTENTS = {"1/chair.obj": BOX_OBJ, "1/note.txt": b"a second file, so that names keep their folder"}
_PROGRAM = """
import com.eteks.sweethome3d.io.*;
import java.io.*;
public class Record {
  public static void main(String[] args) throws Exception {
    DefaultHomeInputStream in = new DefaultHomeInputStream(new File(args[0]),
        ContentRecording.INCLUDE_ALL_CONTENT, new HomeXMLHandler(null), null, false);
    DefaultHomeOutputStream out = new DefaultHomeOutputStream(new FileOutputStream(args[1]), 9, false);
    out.writeHome(in.readHome());
    out.close();
  }
}
"""


def main() -> None:
    """Write java_home.bin."""
    jar = str(homes_package.fetch().jar)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "Record.java").write_text(_PROGRAM)
        (folder / "in.sh3d").write_bytes(sh3d(JAVA_HOME_XML, CONTENTS))
        subprocess.run(["javac", "-cp", jar, "Record.java"], cwd=folder, check=True)
        words = ["-Djava.awt.headless=true", "-cp", f"{jar}:{folder}", "Record", "in.sh3d", "out"]
        subprocess.run(["java", *words], cwd=folder, check=True)
        with zipfile.ZipFile(io.BytesIO((folder / "out").read_bytes())) as archive:
            RECORD.write_bytes(archive.read("Home"))


if __name__ == "__main__":
    main()
