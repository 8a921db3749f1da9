package colonnade

import colonnade.config.ConfigError

import java.nio.charset.StandardCharsets.UTF_8
import java.nio.file.LinkOption.NOFOLLOW_LINKS
import java.nio.file.StandardCopyOption.{ATOMIC_MOVE, REPLACE_EXISTING}
import java.nio.file.{Files, Path, Paths}
import java.util.Comparator
import scala.util.Using

/** Writes files and directories atomically: under a temporary name in the same directory, then moved. */
object OutputFiles {

  /** Writes a new file, or replaces a regular writable one; a link, directory, pipe or device is refused. */
  def writeFile(file: Path, text: String): Unit = {
    if (Files.isDirectory(file)) throw new ConfigError(s"$file is a directory; name a file")
    if (Files.isSymbolicLink(file)) throw new ConfigError(s"$file is a symbolic link; name the file itself")
    if (Files.exists(file, NOFOLLOW_LINKS)) {
      if (!Files.isRegularFile(file, NOFOLLOW_LINKS)) throw new ConfigError(s"$file is no regular file; name another")
      if (!Files.isWritable(file) || !isWritableByAnybody(file))
        throw new ConfigError(s"$file is read-only; name another file")
    }
    Files.createDirectories(file.getParent)
    val fresh = Files.createTempFile(file.getParent, ".colonnade.", ".partial")
    try {
      Files.writeString(fresh, text, UTF_8)
      fresh.toFile.setReadable(true, false)
      Files.move(fresh, file, REPLACE_EXISTING, ATOMIC_MOVE)
    } finally Files.deleteIfExists(fresh)
  }

  /** Fills a new directory and replaces `directory` with it, which may be empty or an unchanged earlier output. */
  def replaceDirectory(directory: Path)(fill: Path => Unit): Unit = {
    checkReplaceable(directory)
    val parent = Option(directory.getParent).getOrElse(throw new ConfigError(s"$directory cannot be an output"))
    Files.createDirectories(parent)

    val fresh = Files.createTempDirectory(parent, ".colonnade.partial-")
    try {
      fill(fresh)
      DesignMarker.write(fresh)
      open(fresh)
      checkReplaceable(directory)
      val old = fresh.resolveSibling(s"${fresh.getFileName}.old")
      if (Files.exists(directory)) Files.move(directory, old, ATOMIC_MOVE)
      Files.move(fresh, directory, ATOMIC_MOVE)
      delete(old)
    } finally delete(fresh)
  }

  private def checkReplaceable(directory: Path): Unit = {
    if (Files.isSymbolicLink(directory))
      throw new ConfigError(s"$directory is a symbolic link; name the directory itself")
    if (Files.exists(directory) && !Files.isDirectory(directory))
      throw new ConfigError(s"$directory is a file; name a directory for the output")
    if (Files.isDirectory(directory)) {
      if (Files.isSameFile(directory, Paths.get("").toAbsolutePath))
        throw new ConfigError(s"$directory is the working directory, which cannot be replaced; name a directory in it")
      DesignMarker
        .foreign(directory)
        .foreach(reason =>
          throw new ConfigError(s"$directory $reason, so it is not replaced; name another, or delete it first")
        )
    }
  }

  /** Also applies to the superuser, who may write every file. */
  private def isWritableByAnybody(file: Path): Boolean =
    !Files.getFileStore(file).supportsFileAttributeView("posix") ||
      Files.getPosixFilePermissions(file).toString.contains("WRITE")

  /** A temporary directory is private; an output gets the default permissions. */
  private def open(directory: Path): Unit = {
    directory.toFile.setReadable(true, false)
    directory.toFile.setExecutable(true, false)
    ()
  }

  private def delete(tree: Path): Unit =
    if (Files.exists(tree))
      Using.resource(Files.walk(tree))(_.sorted(Comparator.reverseOrder[Path]()).forEach(Files.delete(_)))
}
