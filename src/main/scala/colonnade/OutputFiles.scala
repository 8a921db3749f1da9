package colonnade

import colonnade.config.ConfigError

import java.nio.charset.StandardCharsets.UTF_8
import java.nio.file.StandardCopyOption.{ATOMIC_MOVE, REPLACE_EXISTING}
import java.nio.file.{Files, Path}
import java.util.Comparator
import scala.util.Using

/** Files and directories that appear complete or not at all: written under another name beside, then moved. */
object OutputFiles {

  def writeFile(file: Path, text: String): Unit = {
    if (Files.isDirectory(file)) throw new ConfigError(s"$file is a directory; name a file")
    Files.createDirectories(file.getParent)
    val fresh = Files.createTempFile(file.getParent, s".${file.getFileName}.", ".partial")
    try {
      Files.writeString(fresh, text, UTF_8)
      fresh.toFile.setReadable(true, false)
      Files.move(fresh, file, REPLACE_EXISTING, ATOMIC_MOVE)
    } finally Files.deleteIfExists(fresh)
  }

  /** Fills a new directory and puts it in the place of `directory`, which may hold an earlier output but nothing else. */
  def replaceDirectory(directory: Path)(fill: Path => Unit): Unit = {
    if (Files.exists(directory) && !Files.isDirectory(directory))
      throw new ConfigError(s"$directory is a file; name a directory for the output")
    if (!isReplaceable(directory))
      throw new ConfigError(s"$directory holds other files and no manifest.json; name another directory for the output")
    val parent = Option(directory.getParent).getOrElse(throw new ConfigError(s"$directory cannot be an output"))
    Files.createDirectories(parent)

    val fresh = Files.createTempDirectory(parent, s".${directory.getFileName}.partial-")
    try {
      fill(fresh)
      open(fresh)
      val old = fresh.resolveSibling(s"${fresh.getFileName}.old")
      if (Files.exists(directory)) Files.move(directory, old, ATOMIC_MOVE)
      Files.move(fresh, directory, ATOMIC_MOVE)
      delete(old)
    } finally delete(fresh)
  }

  private def isReplaceable(directory: Path): Boolean =
    !Files.exists(directory) || Files.exists(directory.resolve("manifest.json")) || entries(directory).isEmpty

  private def entries(directory: Path): Seq[Path] =
    Using.resource(Files.list(directory))(_.toArray.toSeq.map(_.asInstanceOf[Path]))

  /** A temporary directory is its owner's alone; an output is for everybody. */
  private def open(directory: Path): Unit = {
    directory.toFile.setReadable(true, false)
    directory.toFile.setExecutable(true, false)
    ()
  }

  private def delete(tree: Path): Unit =
    if (Files.exists(tree))
      Using.resource(Files.walk(tree))(_.sorted(Comparator.reverseOrder[Path]()).forEach(Files.delete(_)))
}
