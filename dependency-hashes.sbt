// Holds every artifact that sbt resolves to its SHA-256 in project/dependencies.sha256: dependencies, plugins,
// compiler. project/dependency-hashes.sbt links here, so that the build of the build (its plugins) is held by the same
// lines.

import sbt.librarymanagement._

val dependencyHashes = settingKey[File]("The committed SHA-256 of every artifact; tools/lock makes it again")
dependencyHashes := {
  val here = baseDirectory.value / "dependencies.sha256"
  if (here.isFile) here else baseDirectory.value / "project" / here.getName
}

// A file is hashed once in a session.
val hashed = new java.util.concurrent.ConcurrentHashMap[(File, Long, Long), String]

def sha256(file: File): String =
  hashed.computeIfAbsent(
    (file, file.length, file.lastModified),
    _ => {
      val digest = java.security.MessageDigest.getInstance("SHA-256")
      val input  = new java.security.DigestInputStream(new java.io.FileInputStream(file), digest)
      val buffer = new Array[Byte](1 << 16)
      try while (input.read(buffer) >= 0) {}
      finally input.close()
      digest.digest.map("%02x".format(_)).mkString
    }
  )

// What was resolved, as organization:name:version:file. An editor may ask for sources and documentation: they never
// run.
def artifacts(report: UpdateReport): Seq[(File, String)] = (for {
  configuration    <- report.configurations
  module           <- configuration.modules
  (artifact, file) <- module.artifacts
  if !artifact.classifier.exists(Set("sources", "javadoc"))
  id = module.module
} yield file -> s"${id.organization}:${id.name}:${id.revision}:${file.getName}").distinct

// Refuses what the committed file does not hold. tools/lock sets COLONNADE_LOCK to a file that notes the lines instead.
def held(report: UpdateReport, hashes: File): UpdateReport = {
  sys.env.get("COLONNADE_LOCK") match {
    case Some(notes) =>
      IO.writeLines(
        file(notes),
        artifacts(report).map { case (file, name) => s"${sha256(file)}  $name" },
        append = true
      )
    case None =>
      val known = IO.readLines(hashes).map(_.splitAt(66)).map { case (hash, name) => name -> hash.trim }.toMap
      for ((file, name) <- artifacts(report) if !known.get(name).contains(sha256(file)))
        refuse(
          if (known.contains(name)) s"$file is not the $name of $hashes (another SHA-256): delete it and try again"
          else s"$name is not in $hashes: run tools/lock if this dependency is meant"
        )
  }
  report
}

def refuse(message: String): Nothing = throw new MessageOnlyException(s"colonnade: error: $message")

// Every resolution, also those of the compiler's bridge and of scalafmt, before anything of it is loaded.
dependencyResolution := {
  val resolver = dependencyResolution.value
  val hashes   = dependencyHashes.value
  DependencyResolution(new DependencyResolutionInterface {
    def moduleDescriptor(settings: ModuleDescriptorConfiguration): ModuleDescriptor =
      resolver.moduleDescriptor(settings)
    def update(
        module:        ModuleDescriptor,
        configuration: UpdateConfiguration,
        warnings:      UnresolvedWarningConfiguration,
        log:           Logger
    ): Either[UnresolvedWarning, UpdateReport] =
      resolver.update(module, configuration, warnings, log).right.map(held(_, hashes))
  })
}

// sbt remembers a resolution: look at its files again in every session. sbt itself was loaded before this file was,
// by an `sbt` on PATH; tools/sbt looks at its files before it starts them.
update := {
  val hashes   = dependencyHashes.value
  val provider = appConfiguration.value.provider
  if (!sys.env.contains("COLONNADE_LOCK")) {
    val known = IO.readLines(hashes).map(_.take(64)).toSet
    for (file <- provider.mainClasspath ++ provider.scalaProvider.jars if !known(sha256(file)))
      refuse(s"$file of sbt itself is not in $hashes: delete it and run tools/sbt")
  }
  held(update.value, hashes)
}
