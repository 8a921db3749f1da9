package colonnade

import colonnade.config.{ConfigIO, PathConfig}
import org.scalatest.flatspec.AnyFlatSpec

import java.nio.charset.StandardCharsets.UTF_8
import java.nio.file.{Files, Path, Paths}
import java.security.MessageDigest

class ProgramGraphsSpec extends AnyFlatSpec {
  behavior of "ProgramGraphs"

  private def inDocs(name: String): Path = Paths.get("docs", "diagrams", "programs", name)

  it should "be the graphs in docs/diagrams/programs" in {
    for ((name, graph) <- ProgramGraphs(PathConfig(ConfigIO.load("small"))))
      withClue(s"$name has changed; run tools/regenerate: ") {
        assert(Files.readString(inDocs(name)) == graph)
        val hash = MessageDigest.getInstance("SHA-256").digest(graph.getBytes(UTF_8)).map(byte => f"$byte%02x").mkString
        assert(Files.readString(inDocs(name.replace(".dot", ".svg"))).contains(s"$name, sha256 $hash "))
      }
  }
}
