package colonnade.bus

import colonnade.axi.AxiLite
import colonnade.config.ConfigIO
import colonnade.formats.{Manifest, RegisterMap}
import org.scalatest.flatspec.AnyFlatSpec

import java.nio.file.{Files, Paths}
import scala.jdk.CollectionConverters._

class ShellMapSpec extends AnyFlatSpec {
  behavior of "ShellMap"

  it should "give each register words of its own, below the device's" in {
    val words = ShellMap.registers.flatMap(r => (0 until r.words).map(word => r.address + word * AxiLite.dataBits / 8))
    assert(words.distinct == words && words.forall(word => word % 4 == 0 && word < ShellMap.deviceBase))
  }

  it should "place the fields of a register in its bits, apart from each other" in {
    for (register <- ShellMap.registers) {
      val taken = register.fields.flatMap(field => field.offset until field.end)
      assert(taken.distinct == taken && taken.forall(_ < register.width), register.name)
    }
  }

  it should "hold all digits of the format hash" in {
    val config = ConfigIO.load("small")
    assert(ShellMap.formatHash(config).map(word => f"$word%08x").mkString == Manifest(config)("formatHash").str)
  }

  it should "let a driver write all registers of the device but those that only the device writes" in {
    val config   = ConfigIO.load("edge")
    val writable = ShellMap.writableWords(config).toSet
    assert(ShellMap.postedWrites(config) >= writable.size)
    for (register <- RegisterMap(config); word <- register.address until register.address + register.words)
      assert(writable(word) == (register.access.label == "rw" || register.name == "control.invalidate"), register.name)
  }

  it should "be the table of docs/bus-shell.md" in {
    val rows     = Files.readAllLines(Paths.get("docs", "bus-shell.md")).asScala.filter(_.startsWith("|0x"))
    val expected = ShellMap.registers.filterNot(_.name.matches("formatHash.[1-7].|refit.bounds.[1-5].")).map {
      register =>
        (f"0x${register.address}%02x", register.name, register.access.label)
    }
    assert(rows.map { row =>
      val cells = row.split('|').map(_.trim)
      (cells(1), cells(2).split('`')(1), cells(4))
    } == expected)
  }
}
