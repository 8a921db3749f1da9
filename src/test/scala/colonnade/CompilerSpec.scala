package colonnade

import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import java.nio.file.{Files, Path, Paths}
import scala.sys.process.{Process, ProcessLogger}
import scala.util.Try

/** Tests the C++ compiler of the simulators with a pattern that g++ 12.2 miscompiles. */
class CompilerSpec extends AnyFlatSpec with Matchers {
  behavior of "The C++ compiler"

  private val canary: Path = Paths.get("host/colonnade/device/harness/canary.cpp")

  it should "count right with the flags of the specs' simulators" in {
    assume(Try(Process("g++ --version").!!(ProcessLogger(_ => ()))).isSuccess, "g++ is not installed")
    val folder = Files.createTempDirectory("colonnade-canary")
    try
      for (optimisation <- Seq("-O1", "-O2", "-O3")) {
        val program = folder.resolve("canary").toString
        val flags   = Seq("-std=c++17", optimisation) ++ Simulation.safeFlags
        Process(Seq("g++") ++ flags ++ Seq("-o", program, canary.toString)).! shouldBe 0
        withClue(s"with $optimisation: ")(Process(Seq(program)).! shouldBe 0)
      }
    finally {
      Files.deleteIfExists(folder.resolve("canary"))
      Files.deleteIfExists(folder)
    }
  }
}
