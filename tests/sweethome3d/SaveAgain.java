import com.eteks.sweethome3d.io.HomeFileRecorder;
import com.eteks.sweethome3d.model.Home;

/** Reads each home of the arguments with the real program and writes it to the next one. */
public class SaveAgain {
  public static void main(String[] paths) throws Exception {
    for (int i = 0; i + 1 < paths.length; i += 2) {
      HomeFileRecorder recorder = new HomeFileRecorder(0, true, null, false, true);
      Home home = recorder.readHome(paths[i]);
      recorder.writeHome(home, paths[i + 1]);
      System.out.println(home.getWalls().size() + " " + home.getRooms().size() + " "
          + home.getFurniture().size());
    }
  }
}
