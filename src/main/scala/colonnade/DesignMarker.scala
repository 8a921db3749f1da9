package colonnade

import java.nio.charset.MalformedInputException
import java.nio.file.LinkOption.NOFOLLOW_LINKS
import java.nio.file.{Files, Path}
import java.security.MessageDigest
import scala.jdk.CollectionConverters._
import scala.util.Using

/** Marks the directories that the generator wrote: `.colonnade.sha256` lists every other file with its SHA-256, in the
  * format of `sha256sum --check`. The host's `design_folder.py` writes and reads the same file.
  */
object DesignMarker {
  val name: String = ".colonnade.sha256"

  /** Its first line; `sha256sum` skips it. */
  val title: String =
    "# Written by colonnade generate, which replaces this folder only while its files are as listed here."

  private val maxBytes = 1 << 24

  /** Lists the files of a complete directory. */
  def write(directory: Path): Unit = {
    val lines = names(directory).filter(_ != name).map(file => s"${digest(directory.resolve(file))}  $file")
    Files.writeString(directory.resolve(name), (title +: lines).mkString("", "\n", "\n"))
    ()
  }

  /** The reason why the directory is not an unchanged output; none if it is one, or is empty. */
  def foreign(directory: Path): Option[String] =
    if (Using.resource(Files.list(directory))(!_.iterator.hasNext)) None
    else if (!Files.isRegularFile(directory.resolve(name), NOFOLLOW_LINKS))
      Some(s"holds files, but no $name of colonnade generate")
    else
      read(directory.resolve(name)) match {
        case None           => Some(s"has a $name that cannot be read")
        case Some(expected) => strange(directory).orElse(difference(directory, entries(directory), expected))
      }

  private def strange(directory: Path): Option[String] =
    entries(directory)
      .find(path => !Files.isDirectory(path, NOFOLLOW_LINKS) && !Files.isRegularFile(path, NOFOLLOW_LINKS))
      .map(path => unknown(relative(directory, path)))

  private def difference(directory: Path, found: Seq[Path], expected: Map[String, String]): Option[String] = {
    val (folders, files) = found.partition(Files.isDirectory(_, NOFOLLOW_LINKS))
    val present          = files.map(relative(directory, _)).filter(_ != name).toSet
    val needed           = expected.keySet.flatMap(file => parents(file))
    val extra            = (present -- expected.keySet) ++ folders.map(relative(directory, _)).filterNot(needed)
    val missing          = expected.keySet -- present
    val changed          = (expected.keySet & present).filter(file => digest(directory.resolve(file)) != expected(file))
    if (extra.nonEmpty) Some(unknown(extra.min))
    else if (missing.nonEmpty) Some(s"lacks ${missing.min}, which colonnade generate wrote")
    else if (changed.nonEmpty) Some(s"holds ${changed.min}, which was changed after colonnade generate wrote it")
    else None
  }

  private def unknown(file: String): String = s"holds $file, which colonnade generate did not write"

  /** SHA-256 by name; none if the file is not such a list. */
  private def read(file: Path): Option[Map[String, String]] =
    if (Files.size(file) > maxBytes) None
    else
      try {
        val lines   = Files.readString(file).split("\n", -1).toSeq
        val entries = lines.drop(1).dropRight(1).map(_.split("  ", 2))
        val isOurs  = lines.size > 1 && lines.head == title && lines.last.isEmpty
        if (isOurs && entries.forall(entry => entry.length == 2 && entry(0).length == 64 && entry(1).nonEmpty))
          Some(entries.map(entry => entry(1) -> entry(0)).toMap)
        else None
      } catch { case _: MalformedInputException => None }

  private def names(directory: Path): Seq[String] =
    entries(directory).filter(Files.isRegularFile(_)).map(relative(directory, _)).sorted

  private def entries(directory: Path): Seq[Path] =
    Using.resource(Files.walk(directory))(_.iterator.asScala.filter(_ != directory).toList)

  private def parents(file: String): Seq[String] =
    file.split("/").toSeq.inits.map(_.mkString("/")).filter(folder => folder.nonEmpty && folder != file).toSeq

  private def relative(directory: Path, file: Path): String = directory.relativize(file).iterator.asScala.mkString("/")

  private def digest(file: Path): String = {
    val sha256 = MessageDigest.getInstance("SHA-256")
    Using.resource(Files.newInputStream(file)) { stream =>
      val block = new Array[Byte](1 << 20)
      Iterator.continually(stream.read(block)).takeWhile(_ > 0).foreach(sha256.update(block, 0, _))
    }
    sha256.digest.map(byte => f"${byte & 0xff}%02x").mkString
  }
}
