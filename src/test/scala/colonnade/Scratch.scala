package colonnade

import java.nio.file.{Files, Path}
import java.util.Comparator
import scala.jdk.CollectionConverters._
import scala.util.Using

/** Temporary folders of specs that write files. */
object Scratch {

  /** Runs with an empty folder, which is removed afterwards. */
  def apply[T](body: Path => T): T = {
    val scratch = Files.createTempDirectory("colonnade")
    try body(scratch)
    finally Using.resource(Files.walk(scratch))(_.sorted(Comparator.reverseOrder[Path]()).forEach(Files.delete(_)))
  }

  /** The names in a folder, in order. */
  def names(folder: Path): Seq[String] =
    Using.resource(Files.list(folder))(_.iterator.asScala.map(_.getFileName.toString).toSeq.sorted)
}
