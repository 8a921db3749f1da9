package colonnade

import chisel3._
import colonnade.config.{ConfigError, ConfigIO}
import colonnade.formats.Manifest
import colonnade.numbers.Divider
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import java.io.ByteArrayOutputStream
import java.nio.file.{Files, Path}
import java.util.Comparator
import scala.jdk.CollectionConverters._
import scala.sys.process.{Process, ProcessLogger}
import scala.util.{Try, Using}

class GenerateSpec extends AnyFlatSpec with Matchers {
  behavior of "Generate"

  private def inScratch(body: Path => Unit): Unit = {
    val scratch = Files.createTempDirectory("colonnade")
    try body(scratch)
    finally Using.resource(Files.walk(scratch))(_.sorted(Comparator.reverseOrder[Path]()).forEach(Files.delete(_)))
  }

  private def names(directory: Path): Seq[String] =
    Using.resource(Files.list(directory))(_.iterator.asScala.map(_.getFileName.toString).toSeq.sorted)

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

  it should "write the manifest alone, and nothing beside it" in inScratch { scratch =>
    val output = scratch.resolve("a/b")
    run("--config", "tiny", "--set", "array.rows=3", s"--output=$output", "--manifest-only") shouldBe ((0, ""))
    ujson.read(Files.readString(output.resolve("manifest.json"))) shouldBe
      Manifest(ConfigIO.load("tiny", Seq("array.rows=3")))
    names(output) shouldBe Seq(DesignMarker.name, "manifest.json")
    names(output.getParent) shouldBe Seq("b")
  }

  it should "write the registers of the AXI4 shell beside the same manifest" in inScratch { scratch =>
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

  it should "refuse a pixel stream without the shell" in inScratch { scratch =>
    val output = scratch.resolve("out").toString
    refused("--config", "tiny", "--output", output, "--manifest-only", "--pixel-stream")("it needs --axi")
    run("--config", "tiny", "--output", output, "--manifest-only", "--axi", "16", "--pixel-stream")._1 shouldBe 0
  }

  it should "replace an earlier output, but no other directory" in inScratch { scratch =>
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

  it should "recognise its own directories by their file list" in inScratch { scratch =>
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

  it should "leave an earlier output as it was when the new one fails" in inScratch { scratch =>
    val output = scratch.resolve("out")
    run("--config", "tiny", "--output", output.toString, "--manifest-only")
    an[ArithmeticException] should be thrownBy OutputFiles.replaceDirectory(output) { fresh =>
      OutputFiles.writeFile(fresh.resolve("half"), "")
      throw new ArithmeticException
    }
    names(output) shouldBe Seq(DesignMarker.name, "manifest.json")
    names(scratch) shouldBe Seq("out")
  }

  it should "refuse wrong input in one line" in inScratch { scratch =>
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

  it should "describe each target" in inScratch { scratch =>
    Files.writeString(scratch.resolve("filelist.f"), "Divider.sv\n")
    CoreFile.write("Divider", scratch)
    val targets =
      Files.readString(scratch.resolve(CoreFile.name)).split("\ntargets:\n").last.split("(?m)^  (?=\\w)").tail
    targets.map(_.takeWhile(_ != ':')) shouldBe Seq("default", "lint", "sim", "synth")
    targets.flatMap(_.linesIterator.filter(_.startsWith("    description: "))).distinct should have size 4
  }

  behavior of "Emit"

  it should "write a file for each module and their list" in inScratch { scratch =>
    Emit(new Divider(32, 18), scratch, blackBoxMemories = false)
    names(scratch) shouldBe Seq("Divider.sv", "filelist.f")
    Files.readString(scratch.resolve("filelist.f")).trim shouldBe "Divider.sv"
    Files.readString(scratch.resolve("Divider.sv")) should not include "RANDOM"
  }

  it should "write Verilog that passes Verilator's linter, except for unused bits" in inScratch { scratch =>
    assume(Try(Process("verilator --version").!!).isSuccess, "verilator is not installed")
    Emit(new Divider(32, 18), scratch, blackBoxMemories = false)
    val lint =
      Seq("verilator", "--lint-only", "-Wall", "-Wno-UNUSEDSIGNAL", "--top-module", "Divider", "-f", "filelist.f")
    val said = new StringBuilder
    withClue(said) {
      Process(lint, scratch.toFile).!(ProcessLogger(line => said ++= line + "\n")) shouldBe 0
    }
  }

  it should "leave memories out and describe their shapes on demand" in inScratch { scratch =>
    Emit(new EmitSpecMemory, scratch, blackBoxMemories = true)
    names(scratch) should not contain "mems.conf"
    val memories = ujson.read(Files.readString(scratch.resolve("memories.json"))).arr
    memories.map(m => (m("depth").num, m("width").num)) shouldBe Seq((64, 20))
    memories.head("ports").arr.map(_.str).sorted shouldBe Seq("read", "write")
  }
}

private class EmitSpecMemory extends Module {
  val writeAddress = IO(Input(UInt(6.W)))
  val readAddress  = IO(Input(UInt(6.W)))
  val write        = IO(Input(Bool()))
  val data         = IO(Input(UInt(20.W)))
  val read         = IO(Output(UInt(20.W)))

  private val memory = SyncReadMem(64, UInt(20.W))
  when(write)(memory.write(writeAddress, data))
  read := memory.read(readAddress)
}
