ThisBuild / organization := "colonnade"
ThisBuild / version      := "0.1.0-SNAPSHOT"
ThisBuild / scalaVersion := "2.13.15"
ThisBuild / licenses     := Seq("Apache-2.0" -> url("https://www.apache.org/licenses/LICENSE-2.0"))

val chiselVersion = "6.7.0"
// The one that this Chisel asks for. On the class path its hash is checked; else Chisel would download it unchecked.
val firtoolVersion = "1.62.1"

lazy val colonnade = (project in file("."))
  .settings(
    name := "colonnade",
    libraryDependencies ++= Seq(
      "org.chipsalliance" %% "chisel"          % chiselVersion,
      "com.lihaoyi"       %% "upickle"         % "3.1.0",
      "org.chipsalliance"  % "llvm-firtool"    % firtoolVersion % Runtime,
      "edu.berkeley.cs"   %% "chiseltest"      % "6.0.0"        % Test,
      "org.scalatestplus" %% "scalacheck-1-17" % "3.2.17.0"     % Test // for chiseltest's scalatest
    ),
    // It is there to download firtool unchecked.
    excludeDependencies += ExclusionRule("io.get-coursier", "coursier_2.13"),
    addCompilerPlugin("org.chipsalliance" % "chisel-plugin" % chiselVersion cross CrossVersion.full),
    scalacOptions ++= Seq(
      "-deprecation",
      "-feature",
      "-unchecked",
      "-Xfatal-warnings",
      "-Xlint:unused,infer-any,missing-interpolator",
      "-language:reflectiveCalls",
      "-Ymacro-annotations"
    ),
    // The presets and the list of their names, so that they are found from any directory.
    Compile / resourceGenerators += Def.task {
      val presets = (baseDirectory.value / "configs" * "*.json").get()
      val target  = (Compile / resourceManaged).value / "colonnade" / "configs"
      val names   = target / "names"
      IO.writeLines(names, presets.map(_.getName.stripSuffix(".json")).sorted)
      names +: presets.map { preset =>
        IO.copyFile(preset, target / preset.getName)
        target / preset.getName
      }
    }.taskValue,
    // The generator with its libraries and firtool as one file, the same for the same sources: tools/release.
    assembly / mainClass             := Some("colonnade.Generate"),
    assembly / assemblyOutputPath    := baseDirectory.value / ".cache" / "release" / "colonnade-generator.jar",
    assembly / assemblyMergeStrategy := {
      case path if path.startsWith("META-INF/semanticdb")    => MergeStrategy.discard
      case path if path.endsWith("module-info.class")        => MergeStrategy.discard
      case path if path.matches(".*/bin/om-linker(\\.exe)?") => MergeStrategy.discard
      case path                                              => (assembly / assemblyMergeStrategy).value(path)
    },
    // A black box to copy: it compiles, and has the pins of its Verilog.
    Test / unmanagedSources += baseDirectory.value / "examples" / "axi4" / "ColonnadeAxi4.scala",
    // Elaboration recurses deeply; a fork also keeps the simulators' memory out of sbt. Its simulations repeat a few
    // loops for minutes: the optimising compiler, which .jvmopts leaves out, halves their time.
    Test / fork := true,
    Test / javaOptions ++=
      IO.readLines(baseDirectory.value / ".jvmopts").filter(_.startsWith("-")).filterNot(_.contains("Tiered")),
    Test / testForkedParallel := true,
    // The simulators are compiled with the flags of the specs, not with those of the user; and without optimisation:
    // compiling takes longer than the short simulations.
    Test / envVars ++= Seq("MFLAGS", "GNUMAKEFLAGS", "CFLAGS", "CXXFLAGS", "CPPFLAGS", "LDFLAGS").map(_ -> "").toMap ++
      Map("MAKEFLAGS" -> "OPT_FAST=-O0", "OBJCACHE" -> s"'${baseDirectory.value / "tools" / "verilated-object"}'"),
    Test / testOptions += Tests.Argument(TestFrameworks.ScalaTest, "-oD"),
    // `make verify` sets the variable.
    Test / testOptions ++= (
      if (sys.env.get("COLONNADE_MATRIX").contains("1")) Nil
      else Seq(Tests.Argument(TestFrameworks.ScalaTest, "-l", "colonnade.Matrix"))
    )
  )

// Two suites at a time: a simulator in each wants a core of its own.
Global / concurrentRestrictions += Tags.limit(Tags.Test, 2)
