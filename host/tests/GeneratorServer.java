import java.io.BufferedReader;
import java.io.InputStreamReader;
import java.util.List;
import scala.jdk.javaapi.CollectionConverters;

/** Runs the generator for each line of its input, words between tabs, and prints the status of each. */
public final class GeneratorServer {
    public static void main(String[] none) throws Exception {
        var input = new BufferedReader(new InputStreamReader(System.in));
        for (var line = input.readLine(); line != null; line = input.readLine()) {
            var words = CollectionConverters.asScala(List.of(line.split("\t"))).toSeq();
            System.out.println("status " + colonnade.Generate.run(words));
        }
    }
}
