package colonnade

import colonnade.config.ConfigIO
import org.scalatest.flatspec.AnyFlatSpec

import java.nio.file.{Files, Paths}

class ProgramGraphsSpec extends AnyFlatSpec {
  behavior of "ProgramGraphs"

  it should "be the graphs in docs/diagrams" in {
    for ((name, graph) <- ProgramGraphs(ConfigIO.load("small"))) {
      val file = Paths.get("docs", "diagrams", name)
      withClue(s"$name has changed; write it again: colonnade.ProgramGraphs --target-dir docs/diagrams: ") {
        assert(Files.readString(file) == graph)
      }
    }
  }
}
