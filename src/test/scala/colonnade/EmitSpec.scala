package colonnade

import chisel3._
import colonnade.config.{ColonnadeConfig, ConfigIO, MapEncoding, PathConfig, PrecisionConfig}
import colonnade.numbers.Divider
import colonnade.Scratch.names
import org.scalacheck.{Gen, Prop}
import org.scalacheck.Prop.propBoolean
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import java.nio.charset.StandardCharsets.UTF_8
import java.nio.file.{Files, Path, Paths}
import java.security.MessageDigest
import scala.sys.process.{Process, ProcessLogger}
import scala.util.Try

class EmitSpec extends AnyFlatSpec with Matchers with Properties {
  behavior of "Emit"

  it should "write a file for each module and their list" in Scratch { scratch =>
    Emit(new Divider(32, 18), scratch, blackBoxMemories = false)
    names(scratch) shouldBe Seq("Divider.sv", "filelist.f")
    Files.readString(scratch.resolve("filelist.f")).trim shouldBe "Divider.sv"
    Files.readString(scratch.resolve("Divider.sv")) should not include "RANDOM"
  }

  it should "leave memories out and describe their shapes on demand" in Scratch { scratch =>
    Emit(new EmitSpecMemory, scratch, blackBoxMemories = true)
    names(scratch) should not contain "mems.conf"
    val memories = ujson.read(Files.readString(scratch.resolve("memories.json"))).arr
    memories.map(m => (m("depth").num, m("width").num)) shouldBe Seq((64, 20))
    memories.head("ports").arr.map(_.str).sorted shouldBe Seq("read", "write")
  }

  behavior of "The Verilog of an array"

  private val small    = ConfigIO.load("small")
  private val treeless = small.copy(geometry = small.geometry.copy(bvh = false))
  private val slic     = small.copy(
    physicalAttributeMemory = small.physicalAttributeMemory.map(_.copy(encoding = MapEncoding.Slic))
  )

  private val arrays =
    Seq(
      "3×5" -> array(small, 3, 5),
      "7×1" -> array(TestConfigs.withPipelines(treeless), 7, 1),
      "1×9" -> array(slic, 1, 9)
    )

  // Another one in each run, as the precision
  it should "pass Verilator's linter: one of the arrays, at any precision" in passes(Gen.oneOf(arrays.map(_._2)))

  for ((shape, config) <- arrays)
    it should s"pass Verilator's linter: $shape, at any precision" taggedAs Matrix in passes(Gen.const(config))

  it should "pass Verilator's linter: 40×40" taggedAs Matrix in
    passes(Gen.const(array(small, 40, 40)), Gen.const(small.precision))

  private def array(config: ColonnadeConfig, rows: Int, columns: Int) =
    config.copy(array = config.array.copy(rows = rows, columns = columns))

  private def passes(
      configs:    Gen[ColonnadeConfig],
      precisions: Gen[PrecisionConfig] = ArbitraryConfig.precision
  ): Unit = {
    assume(Try(Process("verilator --version").!!).isSuccess, "verilator is not installed")
    holds(cases = 1)(Prop.forAll(configs, precisions) { (config, precision) =>
      val report = lint(config.copy(precision = precision))
      report.isEmpty :| report
    })
  }

  /** Verilator's warnings for the modules of a device. It reads and checks each module once; with `--lint-only` it
    * would flatten the array, and take a time by its size. Older versions write XML.
    */
  private def lint(config: ColonnadeConfig): String = Scratch { scratch =>
    Emit(new Colonnade(config), scratch, blackBoxMemories = false)
    Iterator("--json-only", "--xml-only").map(verilate(scratch, _)).find(!_.contains("Invalid option")).get
  }

  private def verilate(folder: Path, form: String): String = {
    val waivers = Paths.get("tools", "lint.vlt").toAbsolutePath.toString
    val command = Seq("verilator", form, "-Wall", waivers, "--top-module", "Colonnade", "-f", "filelist.f")
    val said    = new StringBuilder
    val status  = Process(command, folder.toFile).!(ProcessLogger(line => said ++= line + "\n"))
    if (status == 0) "" else said.toString
  }
}

private class EmitSpecMemory extends Module {
  val writeAddress = IO(Input(UInt(6.W)))
  val readAddress  = IO(Input(UInt(6.W)))
  val write        = IO(Input(Bool()))
  val data         = IO(Input(UInt(20.W)))
  val read         = IO(Output(UInt(20.W)))

  private val memory = SyncReadMem(64, UInt(20.W))
  when(write)(memory.write(writeAddress, data))
  read := memory.read(readAddress)
}

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
