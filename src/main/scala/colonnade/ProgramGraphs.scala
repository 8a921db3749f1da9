package colonnade

import chisel3.Module
import circt.stage.ChiselStage
import colonnade.config.{ConfigError, ConfigIO, PathConfig}
import colonnade.environment.EnvironmentMarch
import colonnade.microcode.Microprogram
import colonnade.shading.{BounceUnit, ShaderGeometry}

import java.nio.file.Paths

/** Writes the state graphs of the microprograms, in Graphviz's DOT. */
object ProgramGraphs {
  private val usage = "usage: colonnade.ProgramGraphs --target-dir DIR"

  def main(arguments: Array[String]): Unit = arguments.toSeq match {
    case Seq("--target-dir", directory) =>
      val target = Paths.get(directory).toAbsolutePath.normalize
      for ((name, graph) <- ProgramGraphs(PathConfig(ConfigIO.load("small"))))
        OutputFiles.writeFile(target.resolve(name), graph)
    case _ => throw new ConfigError(usage)
  }

  /** Text by file name. */
  def apply(config: PathConfig): Map[String, String] = Map(
    "shader-geometry.dot"   -> graph("shader geometry", new ShaderGeometry(config))(_.program),
    "bounce.dot"            -> graph("bounce", new BounceUnit(config))(_.program),
    "environment-march.dot" -> graph("environment march", new EnvironmentMarch(config))(_.program)
  )

  private def graph[M <: Module](name: String, module: => M)(program: M => Microprogram[_]): String = {
    var elaborated = Option.empty[M]
    ChiselStage.emitCHIRRTL {
      elaborated = Some(module)
      elaborated.get
    }
    program(elaborated.get).graph(name)
  }
}
