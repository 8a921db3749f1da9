package colonnade

import chisel3.RawModule
import colonnade.bus.ShellMap
import colonnade.config.{ColonnadeConfig, ConfigError, ConfigIO, Require, ShellConfig}
import colonnade.formats.{FormatsPage, Manifest, RayBatch, RecordFormats}

import java.io.IOException
import java.nio.file.{AccessDeniedException, FileAlreadyExistsException, InvalidPathException, Path, Paths}

/** The generator's command line. Wrong input ends in one line on standard error and exit status 2. */
object Generate {
  private def usage: String =
    s"""Writes the Verilog of a Colonnade, and manifest.json, which tells the host all of its formats.
       |
       |usage: colonnade.Generate --config CONFIG --output DIR [OPTION...]
       |
       |  --config CONFIG       ${ConfigIO.presets.mkString(", ")}, a JSON file, or a precision like 32b32s64d
       |  --set KEY=VALUE       overrides one field, as in array.rows=4; may be repeated
       |  --output DIR          takes the place of an earlier output that nobody changed; never half-written
       |  --manifest-only       writes no Verilog
       |  --axi BYTES           puts the device into its AXI4 shell, with a bus of 4 to 128 BYTES, or of auto: 64 for rays,
       |                        else 16; shell.json has its registers
       |  --pixel-stream        gives the shell an AXI4-Stream of pixels, to which frames can go
       |  --refit               gives the shell a unit that bends meshes in DRAM
       |  --black-box-memories  leaves memories to be filled in; memories.json lists their shapes
       |  --formats-page FILE   writes the formats as a Markdown page
       |  --help                prints this
       |""".stripMargin

  private final case class Options(
      config:           Option[String] = None,
      overrides:        Vector[String] = Vector.empty,
      output:           Option[String] = None,
      formatsPage:      Option[String] = None,
      axi:              Option[Option[Int]] = None, // bytes; none: auto
      pixelStream:      Boolean = false,
      refit:            Boolean = false,
      manifestOnly:     Boolean = false,
      blackBoxMemories: Boolean = false,
      help:             Boolean = false
  )

  def main(arguments: Array[String]): Unit = {
    val status = run(arguments.toSeq)
    if (status != 0) sys.exit(status)
  }

  /** Runs the command; returns the exit status. */
  def run(arguments: Seq[String]): Int =
    try {
      val options = parse(arguments.toList, Options())
      if (options.help) print(usage) else generate(options)
      0
    } catch {
      case error: ConfigError => refuse(error.getMessage)
      case error: IOException => refuse(s"cannot write ${reason(error)}")
    }

  private def top(config: ColonnadeConfig, axi: Option[ShellConfig]): RawModule =
    if (config.queries.nonEmpty) axi.fold[RawModule](new ColonnadeRays(config))(new ColonnadeRaysAxi(config, _))
    else axi.fold[RawModule](new Colonnade(config))(new ColonnadeAxi(config, _))

  private def generate(options: Options): Unit = {
    val name          = options.config.getOrElse(throw new ConfigError("--config is missing; see --help"))
    val (config, axi) = Require.all {
      val config = ConfigIO.load(name, options.overrides)
      (config, shell(options, config))
    }
    if (options.output.isEmpty && options.formatsPage.isEmpty)
      throw new ConfigError("--output is missing; see --help")

    options.formatsPage.foreach(file => OutputFiles.writeFile(path(file), FormatsPage(config)))
    options.output.foreach { directory =>
      OutputFiles.replaceDirectory(path(directory)) { fresh =>
        if (!options.manifestOnly) {
          Emit(top(config, axi), fresh, options.blackBoxMemories)
          val name = if (axi.nonEmpty) "ColonnadeAxi" else if (config.queries.nonEmpty) "ColonnadeRays" else "Colonnade"
          CoreFile.write(name, fresh)
        }
        OutputFiles.writeFile(fresh.resolve("manifest.json"), formats.Json.pretty(Manifest(config)))
        for (shell <- axi) OutputFiles.writeFile(fresh.resolve("shell.json"), ShellMap.json(config, shell))
      }
    }
  }

  /** The shell of `--axi`, with what the other options add to it. */
  private def shell(options: Options, config: ColonnadeConfig): Option[ShellConfig] = {
    val rays = config.queries.nonEmpty
    for ((name, isGiven) <- Seq("--pixel-stream" -> options.pixelStream, "--refit" -> options.refit) if isGiven) {
      Require(name, options.axi.nonEmpty, "needs --axi BYTES")
      Require(name, !rays, "is for frames: it does not go with queries")
    }
    if (options.refit && !rays) {
      Require("--refit", config.columnBvhMemory.cache.nonEmpty, "needs columnBvhMemory.cache={}")
      Require("--refit", new RecordFormats(config).recordBits == 256, "needs geometry.vertexBits=19")
    }
    val ownBytes = if (rays) RayBatch.bytes else 16
    options.axi.map(_.getOrElse(ownBytes)).map { bytes =>
      Require("queries", !rays || bytes == RayBatch.bytes, s"needs --axi ${RayBatch.bytes}")
      ShellConfig(bytes, pixelStream = options.pixelStream, refit = options.refit)
    }
  }

  private def parse(arguments: List[String], options: Options): Options = arguments match {
    case Nil                             => options
    case "--help" :: rest                => parse(rest, options.copy(help = true))
    case "--manifest-only" :: rest       => parse(rest, options.copy(manifestOnly = true))
    case "--pixel-stream" :: rest        => parse(rest, options.copy(pixelStream = true))
    case "--refit" :: rest               => parse(rest, options.copy(refit = true))
    case "--black-box-memories" :: rest  => parse(rest, options.copy(blackBoxMemories = true))
    case Valued(name, "", _)             => throw new ConfigError(s"$name needs a value; see --help")
    case Valued("--config", value, rest) => parse(rest, options.copy(config = Some(value)))
    case Valued("--set", value, rest)    => parse(rest, options.copy(overrides = options.overrides :+ value))
    case Valued("--output", value, rest) => parse(rest, options.copy(output = Some(value)))
    case Valued("--axi", value, rest)    =>
      if (value != "auto" && value.toIntOption.isEmpty)
        throw new ConfigError(s"--axi is '$value'; it must be auto or a number of bytes")
      parse(rest, options.copy(axi = Some(value.toIntOption)))
    case Valued("--formats-page", value, rest) => parse(rest, options.copy(formatsPage = Some(value)))
    case unknown :: _                          => throw new ConfigError(s"unknown option $unknown; see --help")
  }

  /** An option with a value, as `--name value` or `--name=value`; an empty value when there is none. */
  private object Valued {
    private val names = Set("--config", "--set", "--output", "--axi", "--formats-page")

    def unapply(arguments: List[String]): Option[(String, String, List[String])] = arguments match {
      case name :: rest if names(name) => Some((name, rest.headOption.getOrElse(""), rest.drop(1)))
      case joined :: rest if names(joined.takeWhile(_ != '=')) =>
        Some((joined.takeWhile(_ != '='), joined.dropWhile(_ != '=').drop(1), rest))
      case _ => None
    }
  }

  private def path(name: String): Path =
    try Paths.get(name).toAbsolutePath.normalize
    catch { case error: InvalidPathException => throw new ConfigError(s"'$name' is no path: ${error.getReason}") }

  /** A message for an I/O error; the JDK's own often contain only the file's name. */
  private def reason(error: IOException): String = error match {
    case taken: FileAlreadyExistsException => s"${taken.getFile}: there is a file where a directory is needed"
    case denied: AccessDeniedException     => s"${denied.getFile}: permission denied"
    case other                             => s"the output: ${other.getMessage}"
  }

  /** Control characters of files and arguments must not reach the terminal. */
  private def plain(text: String): String =
    text.flatMap(char => if (Character.isISOControl(char)) f"\\u${char.toInt}%04x" else char.toString).take(1000)

  private def refuse(reason: String): Int = {
    Console.err.println(s"colonnade.Generate: error: ${plain(reason.linesIterator.mkString(" "))}")
    2
  }
}
