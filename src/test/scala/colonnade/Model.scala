package colonnade

import java.nio.charset.StandardCharsets.UTF_8
import java.nio.file.{Files, Path, Paths, StandardCopyOption}
import java.security.MessageDigest

import chisel3.Data
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.{AttributeMemories, Layout, LeafRecord, RecordFormats}

import scala.jdk.CollectionConverters._
import scala.sys.process._

/** Expected values from the C++ model: `host/cpp/vectors.cpp`, compiled once per version of the sources. */
object Model {

  /** Runs the model on questions; vectors.cpp documents their format. */
  def answers(config: ColonnadeConfig, questions: Seq[Seq[BigInt]], kind: String): Seq[Seq[BigInt]] =
    answers(config, Nil, questions, kind)

  /** Pixels of a scene: red, green, blue, isObject, triangle, distance, and the shadow ratio by channel.
    *
    * @param registers the host's registers, by name
    * @param environment words of each memory of the environment, if there is one
    */
  def pixels(
      config:      ColonnadeConfig,
      registers:   Map[String, BigInt],
      records:     Seq[BigInt],
      positions:   Seq[(Int, Int)],
      environment: Option[Map[String, Seq[BigInt]]] = None
  ): Seq[Seq[BigInt]] = {
    val scene   = s"records ${hexadecimal(config, records)}"
    val written = registers.map { case (name, value) => s"$name=$value" }.mkString("registers ", " ", "")
    val maps    = environment.toSeq.flatMap(environmentOf(config, _))
    answers(
      config,
      recordLayouts(config) ++ maps ++ Seq(scene, written),
      positions.map { case (x, y) => Seq(BigInt(x), BigInt(y)) },
      "pixel"
    )
  }

  /** Runs the model on questions about leaves. */
  def leaves(config: ColonnadeConfig, questions: Seq[Seq[BigInt]], kind: String): Seq[Seq[BigInt]] =
    answers(config, LeafRecord.kinds(config.geometry).map { case (name, kind) => layout(name, kind) }, questions, kind)

  /** Words of the hits of batches of rays; ray_queries.hpp documents the queries.
    *
    * @param image  what comes before the records there
    */
  def batches(
      config:  ColonnadeConfig,
      image:   Seq[BigInt],
      records: Seq[BigInt],
      queries: Seq[Seq[BigInt]]
  ): Seq[Seq[BigInt]] =
    answers(
      config,
      recordLayouts(config) :+ s"image ${image.mkString(" ")} ${hexadecimal(config, records)}",
      queries,
      "batch"
    )

  /** Runs the model on questions about the environment's maps; environment_queries.hpp documents their format.
    *
    * @param words words of each memory of the environment
    */
  def attributes(
      config:    ColonnadeConfig,
      words:     Map[String, Seq[BigInt]],
      questions: Seq[Seq[BigInt]],
      kind:      String
  ): Seq[Seq[BigInt]] = answers(config, environmentOf(config, words), questions, kind)

  private def environmentOf(config: ColonnadeConfig, words: Map[String, Seq[BigInt]]): Seq[String] = {
    val layouts  = AttributeMemories.layouts.map { case (name, word) => layout(name, word()) }
    val sizes    = AttributeLayout.of(config).entries.map { case (key, value) => s"$key=$value" }
    val contents = AttributeMemories(config).map { memory =>
      s"words ${memory.name} ${(memory.bits + 7) / 8} ${words(memory.name).map(_.toString(16)).mkString(" ")}"
    }
    layouts ++ Seq(sizes.mkString("sizes ", " ", "")) ++ contents
  }

  private def recordLayouts(config: ColonnadeConfig): Seq[String] = {
    new RecordFormats(config).kinds.map { case (name, kind) => layout(name, kind) }
  }

  private def hexadecimal(config: ColonnadeConfig, records: Seq[BigInt]): String = {
    val digits = new RecordFormats(config).recordBits / 4
    records.map(record => "0" * (digits - record.toString(16).length) + record.toString(16)).mkString(" ")
  }

  private def layout(name: String, kind: Data): String = {
    val fields = Layout.of(kind).map(field =>
      s"${field.name}=${field.offset},${field.width},${if (field.signed) 1 else 0}"
    )
    s"layout $name ${fields.mkString(" ")}"
  }

  private def answers(
      config:    ColonnadeConfig,
      setting:   Seq[String],
      questions: Seq[Seq[BigInt]],
      kind:      String
  ): Seq[Seq[BigInt]] = {
    val header = "numbers " + (config.numbers.entries ++ traversal(config)).map { case (key, value) =>
      s"$key=$value"
    }.mkString(" ")
    val text =
      ((header +: setting) ++ questions.map(question => (kind +: question.map(_.toString)).mkString(" ")))
        .mkString("", "\n", "\n")
    val output = (Process(program.toString) #< new java.io.ByteArrayInputStream(text.getBytes(UTF_8))).!!
    val result = output.linesIterator.map(_.split(' ').toSeq.map(BigInt(_))).toSeq
    require(result.size == questions.size, s"${result.size} answers to ${questions.size} questions")
    result
  }

  private def traversal(config: ColonnadeConfig): Seq[(String, Int)] = Seq(
    "stackDepth" -> config.columnBvhMemory.stackDepth,
    "bvh"        -> (if (config.geometry.bvh) 1 else 0)
  )

  /** What the C of a target does with a mesh; driver/tests/refit.c has the order of numbers. */
  def refit(numbers: Seq[BigInt]): Seq[BigInt] = {
    val input = new java.io.ByteArrayInputStream(numbers.mkString("", "\n", "\n").getBytes(UTF_8))
    (Process(refitProgram.toString) #< input).!!.trim.split(' ').toSeq.map(BigInt(_))
  }

  private val driver = Paths.get("driver")

  private lazy val program: Path = {
    val sources = Paths.get("host", "cpp")
    built(sources.resolve("vectors.cpp"), Nil, Seq(sources, driver.resolve("include")), "g++", "-std=c++17", "-pthread")
  }

  private lazy val refitProgram: Path = {
    val sources = Seq("colonnade_mesh.c", "colonnade_mesh_plan.c").map(driver.resolve("src").resolve(_))
    val headers = Seq("include", "src").map(driver.resolve(_))
    built(driver.resolve("tests").resolve("refit.c"), sources, headers, "gcc", "-std=c11")
  }

  /** A program, compiled once per version of the sources. */
  private def built(main: Path, sources: Seq[Path], headers: Seq[Path], command: String*): Path = synchronized {
    val files = headers.flatMap(Files.walk(_).iterator.asScala).filter(path =>
      Seq(".hpp", ".h").exists(path.toString.endsWith)
    ).sorted ++ sources :+ main
    val digest = MessageDigest.getInstance("SHA-256")
    files.foreach(file => digest.update(Files.readAllBytes(file)))
    val name  = digest.digest().take(8).map(byte => f"$byte%02x").mkString
    val built = Paths.get("target", "model", s"${main.getFileName.toString.takeWhile(_ != '.')}-$name")
    if (!Files.exists(built)) {
      Files.createDirectories(built.getParent)
      val fresh   = Files.createTempFile(built.getParent, "program", "")
      val options = "-O2" +: headers.flatMap(folder => Seq("-I", folder.toString))
      val exit    = (command ++ options ++ (main +: sources).map(_.toString) ++ Seq("-o", fresh.toString)).!
      require(exit == 0, s"$main did not compile: is ${command.head} installed?")
      Files.move(fresh, built, StandardCopyOption.REPLACE_EXISTING)
    }
    built
  }
}
