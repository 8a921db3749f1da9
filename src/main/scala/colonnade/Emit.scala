package colonnade

import chisel3.{BuildInfo, RawModule}
import circt.stage.ChiselStage
import colonnade.config.ConfigError
import colonnade.formats.Json

import java.nio.file.{Files, Path, Paths}
import scala.jdk.CollectionConverters._

/** Writes the SystemVerilog of a design: a file per module, and their list in `filelist.f`. */
object Emit {

  /** A Verilog style that Verilator, Yosys and older readers accept. */
  private val lowering =
    Seq("disallowLocalVariables", "disallowPackedArrays", "locationInfoStyle=none", "emittedLineLength=120")

  private val memoryList = "mems.conf"

  /** @param blackBoxMemories leaves the bodies of memories out and lists their shapes in `memories.json` */
  def apply(top: => RawModule, directory: Path, blackBoxMemories: Boolean): Unit = {
    requireFirtool()
    val options =
      Seq("-disable-all-randomization", "-strip-debug-info", s"--lowering-options=${lowering.mkString(",")}") ++
        (if (blackBoxMemories) Seq("--repl-seq-mem", s"--repl-seq-mem-file=$memoryList") else Nil)
    ChiselStage.emitSystemVerilogFile(
      top,
      Array("--target-dir", directory.toString, "--split-verilog"),
      options.toArray
    )
    if (blackBoxMemories) describeMemories(directory)
  }

  /** Chisel runs the firtool of `CHISEL_FIRTOOL_PATH`, else the class path's, which has one for some platforms. */
  private def requireFirtool(): Unit = {
    val version = BuildInfo.firtoolVersion.getOrElse("")
    val advice  = s"set CHISEL_FIRTOOL_PATH to the folder of a firtool $version"
    sys.env.get("CHISEL_FIRTOOL_PATH") match {
      case Some(folder) =>
        if (!Files.isExecutable(Paths.get(folder).resolve("firtool")))
          throw new ConfigError(s"CHISEL_FIRTOOL_PATH=$folder holds no program firtool: $advice")
      case None =>
        val os     = System.getProperty("os.name").toLowerCase
        val system = if (os.contains("mac")) "macos" else if (os.contains("win")) "windows" else "linux"
        // Apple's processors translate macos-x64's
        val processor = if (system != "macos" && System.getProperty("os.arch") == "aarch64") "aarch64" else "x64"
        val platform  = s"$system-$processor"
        if (getClass.getResource(s"/org.chipsalliance/llvm-firtool/$platform/bin/firtool") == null)
          throw new ConfigError(s"there is no firtool for $platform, which writes the Verilog: $advice")
    }
  }

  /** Converts firtool's list of memories, with alternating names and values on each line, to JSON. */
  private def describeMemories(directory: Path): Unit = {
    val list     = directory.resolve(memoryList)
    val lines    = if (Files.exists(list)) Files.readAllLines(list).asScala.toSeq.filter(_.trim.nonEmpty) else Nil
    val memories = lines.map { line =>
      val facts = line.trim.split("\\s+").toSeq.grouped(2).collect { case Seq(key, value) => key -> value }.toMap
      ujson.Obj(
        "name"     -> facts("name"),
        "depth"    -> facts("depth").toInt,
        "width"    -> facts("width").toInt,
        "ports"    -> ujson.Arr.from(facts("ports").split(",").map(ujson.Str(_))),
        "maskBits" -> facts.get("mask_gran").fold[ujson.Value](ujson.Null)(bits => ujson.Num(bits.toInt))
      )
    }
    OutputFiles.writeFile(directory.resolve("memories.json"), Json.pretty(ujson.Arr.from(memories)))
    Files.deleteIfExists(list)
    ()
  }
}
