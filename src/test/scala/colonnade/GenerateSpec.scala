package colonnade

import colonnade.Scratch.names
import colonnade.config.{ConfigError, ConfigIO}
import colonnade.formats.Manifest
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import java.io.ByteArrayOutputStream
import java.nio.file.Files
import scala.sys.process.Process

class GenerateSpec extends AnyFlatSpec with Matchers {
  behavior of "Generate"

  private def run(arguments: String*): (Int, String) = {
    val errors = new ByteArrayOutputStream
    val status = Console.withErr(errors)(Generate.run(arguments))
    (status, errors.toString)
  }

  private def refused(arguments: String*)(reason: String): Unit = {
    val (status, errors) = run(arguments: _*)
    status shouldBe 2
    errors should startWith("colonnade.Generate: error: ")
    errors should include(reason)
    errors.linesIterator.size shouldBe 1
    ()
  }

  it should "write the manifest alone, and nothing beside it" in Scratch { scratch =>
    val output = scratch.resolve("a/b")
    run("--config", "tiny", "--set", "array.rows=3", s"--output=$output", "--manifest-only") shouldBe ((0, ""))
    ujson.read(Files.readString(output.resolve("manifest.json"))) shouldBe
      Manifest(ConfigIO.load("tiny", Seq("array.rows=3")))
    names(output) shouldBe Seq(DesignMarker.name, "manifest.json")
    names(output.getParent) shouldBe Seq("b")
  }

  it should "write the registers of the AXI4 shell beside the same manifest" in Scratch { scratch =>
    val output = scratch.resolve("shell")
    run("--config", "tiny", "--axi", "32", s"--output=$output", "--manifest-only") shouldBe ((0, ""))
    names(output) shouldBe Seq(DesignMarker.name, "manifest.json", "shell.json")
    ujson.read(Files.readString(output.resolve("manifest.json"))) shouldBe Manifest(ConfigIO.load("tiny"))
    val shell = ujson.read(Files.readString(output.resolve("shell.json")))
    shell("busBytes").num shouldBe 32
    val registers = shell("registers").arr.map(register => register("name").str -> register).toMap
    registers should contain key "framebuffer.base"
    registers("status")("fields").arr.map(field => (field("name").str, field("offset").num.toInt)) shouldBe
      Seq("isRunning" -> 0, "isQueued" -> 1, "isLoading" -> 2, "isResetting" -> 3)
  }

  it should "refuse a pixel stream without the shell" in Scratch { scratch =>
    val output = scratch.resolve("out").toString
    refused(
      "--config",
      "tiny",
      "--output",
      output,
      "--manifest-only",
      "--pixel-stream"
    )("--pixel-stream needs --axi BYTES")
    run("--config", "tiny", "--output", output, "--manifest-only", "--axi", "16", "--pixel-stream")._1 shouldBe 0
  }

  it should "refuse a refit unit without the shell, a scene in DRAM and records of 256 bits" in Scratch { scratch =>
    val output                               = scratch.resolve("out").toString
    def shell(config: String, more: String*) = Seq("--config", config, "--output", output, "--manifest-only") ++ more
    def needs(options: Seq[String], needed: String) = refused(options: _*)(s"error: $needed\n")
    needs(shell("edge", "--refit"), "--refit needs --axi BYTES")
    needs(
      shell("tiny", "--set", "geometry.vertexBits=24", "--refit"),
      "--refit needs --axi BYTES, columnBvhMemory.cache={}, geometry.vertexBits=19"
    )
    refused(shell("edge", "--axi", "128", "--refit"): _*)("--axi with --refit is 128")
    run(shell("edge", "--axi", "64", "--refit"): _*)._1 shouldBe 0
    val needed = Seq("--set", "columnBvhMemory.cache={}", "--set", "geometry.vertexBits=19")
    run(shell("tiny", "--axi" +: "16" +: "--refit" +: needed: _*): _*)._1 shouldBe 0
    for (option <- Seq("--refit", "--pixel-stream"))
      needs(shell("traversal", "--axi", "64", option), s"$option is for frames: it does not go with queries")
  }

  it should "give a device for rays the bus of a batch" in Scratch { scratch =>
    val output = scratch.resolve("out")
    refused("--config", "traversal", "--axi", "16", "--output", output.toString)("queries needs --axi 64")
    refused("--config", "tiny", "--set", "queries={}", "--axi=16", "--output", output.toString)(
      "queries needs units.rayInterval=1, --axi 64"
    )
    for ((preset, bytes) <- Seq("tiny" -> 16, "traversal" -> 64)) {
      run("--config", preset, "--axi", "auto", "--output", output.toString, "--manifest-only") shouldBe ((0, ""))
      ujson.read(Files.readString(output.resolve("shell.json")))("busBytes").num shouldBe bytes
    }
  }

  it should "replace an earlier output, but no other directory" in Scratch { scratch =>
    val output = scratch.resolve("out")
    for (_ <- 0 until 2) run("--config", "tiny", "--output", output.toString, "--manifest-only")._1 shouldBe 0
    Files.writeString(output.resolve("thesis.txt"), "irreplaceable")
    refused("--config", "tiny", "--output", output.toString, "--manifest-only")("holds thesis.txt")
    names(output) shouldBe Seq(DesignMarker.name, "manifest.json", "thesis.txt")
    Files.delete(output.resolve(DesignMarker.name))
    refused("--config", "tiny", "--output", output.toString, "--manifest-only")(s"no ${DesignMarker.name}")
    refused("--config", "tiny", "--output", output.resolve("thesis.txt").toString, "--manifest-only")("is a file")
    refused(
      "--config",
      "tiny",
      "--output",
      output.resolve("thesis.txt/x").toString,
      "--manifest-only"
    )("thesis.txt: there is a file")
  }

  it should "recognise its own directories by their file list" in Scratch { scratch =>
    val output        = scratch.resolve("out")
    def write(): Unit = OutputFiles.replaceDirectory(output) { fresh =>
      OutputFiles.writeFile(fresh.resolve("a"), "a\n")
      OutputFiles.writeFile(fresh.resolve("sub/b"), "b\n")
    }
    def foreign(change: => Unit): String = {
      write()
      change
      val refusal = the[ConfigError] thrownBy write()
      Process(Seq("rm", "-r", output.toString)).!
      refusal.getMessage
    }
    write()
    // The format of the host's design_folder.py
    Files.readString(output.resolve(DesignMarker.name)).linesIterator.toSeq shouldBe Seq(
      DesignMarker.title,
      "87428fc522803d31065e7bce3cf03fe475096631e5e07bbd7a0fde60c4cf25c7  a",
      "0263829989b6fd954f72baaf2fc64bc2e2f01d692d4de72986ea808f6e99813f  sub/b"
    )
    foreign(Files.writeString(output.resolve("a"), "A\n")) should include("changed")
    foreign(Files.delete(output.resolve("a"))) should include("lacks a")
    foreign(Files.writeString(output.resolve("sub/c"), "")) should include("holds sub/c")
    foreign(Files.createDirectory(output.resolve("empty"))) should include("holds empty")
    foreign(Files.createSymbolicLink(output.resolve("link"), scratch)) should include("holds link")
    foreign(Files.writeString(output.resolve(DesignMarker.name), "")) should include("cannot be read")
    foreign(Files.delete(output.resolve(DesignMarker.name))) should include("holds files")

    Files.createSymbolicLink(output, Files.createDirectory(scratch.resolve("real")))
    the[ConfigError] thrownBy write() should have message
      s"$output is a symbolic link; name the directory itself"
    refused("--config", "tiny", "--output", ".", "--manifest-only")("working directory")
  }

  it should "leave an earlier output as it was when the new one fails" in Scratch { scratch =>
    val output = scratch.resolve("out")
    run("--config", "tiny", "--output", output.toString, "--manifest-only")
    an[ArithmeticException] should be thrownBy OutputFiles.replaceDirectory(output) { fresh =>
      OutputFiles.writeFile(fresh.resolve("half"), "")
      throw new ArithmeticException
    }
    names(output) shouldBe Seq(DesignMarker.name, "manifest.json")
    names(scratch) shouldBe Seq("out")
  }

  it should "refuse wrong input in one line" in Scratch { scratch =>
    val output = scratch.resolve("out").toString
    refused("--config", "tiny", "--output", output, "--manifest-onyl")("unknown option --manifest-onyl")
    refused("--config", "tiny")("--output is missing")
    refused("--output", output)("--config is missing")
    refused("--output", output, "--config")("--config needs a value")
    refused("--config", "nope", "--output", output)("there is no configuration 'nope'")
    refused("--config", "tiny", "--set", "array.rows=0", "--output", output)("array.rows is 0")
    refused("--config", "tiny", "--set", "array.raws=1", "--output", output)("unknown key array.raws")
    refused("--config", "tiny", "--set", "precision.mac=65", "--output", output)("precision.mac is 65")
    refused("--config", "tiny", "--axi", "12", "--output", output)("--axi is 12; it must be one of 4, 8, 16")
    refused("--config", "tiny", "--axi=wide", "--output", output)("--axi is 'wide'")
    names(scratch) shouldBe empty
  }

  it should "print its usage" in {
    val printed = new ByteArrayOutputStream
    Console.withOut(printed)(Generate.run(Seq("--help"))) shouldBe 0
    printed.toString should include("usage:")
    all(ConfigIO.presets.map(name => printed.toString.contains(s"$name, "))) shouldBe true
  }

  behavior of "CoreFile"

  it should "describe each target" in Scratch { scratch =>
    Files.writeString(scratch.resolve("filelist.f"), "Divider.sv\n")
    CoreFile.write("Divider", scratch)
    val targets =
      Files.readString(scratch.resolve(CoreFile.name)).split("\ntargets:\n").last.split("(?m)^  (?=\\w)").tail
    targets.map(_.takeWhile(_ != ':')) shouldBe Seq("default", "lint", "sim", "synth")
    targets.flatMap(_.linesIterator.filter(_.startsWith("    description: "))).distinct should have size 4
  }
}
