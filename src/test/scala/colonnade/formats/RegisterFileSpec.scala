package colonnade.formats

import chiseltest._
import colonnade.OneSimulation
import colonnade.config.{ColonnadeConfig, ConfigIO}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

class RegisterFileSpec extends AnyFlatSpec with OneSimulation with Matchers {
  behavior of "RegisterFile"

  private val config: ColonnadeConfig =
    ConfigIO.load("tiny", Seq("precision=40b32s64d", "frame.materials=2", "frame.lights=2", "frame.maxBounces=4"))
  private val registers = RegisterMap(config)
  private val settings  = registers.filter(_.access == Access.ReadWrite)

  private def write(unit: RegisterFile.OfFrames, address: Int, data: BigInt): Unit = {
    unit.io.register.write.poke(true)
    unit.io.register.address.poke(address)
    unit.io.register.writeData.poke(data)
    unit.clock.step()
    unit.io.register.write.poke(false)
  }

  private def read(unit: RegisterFile.OfFrames, address: Int): BigInt = {
    unit.io.register.read.poke(true)
    unit.io.register.address.poke(address)
    unit.clock.step()
    unit.io.register.read.poke(false)
    val data = unit.io.register.readData.peek().litValue
    unit.io.register.address.poke(0)
    unit.clock.step() // what was read stays
    unit.io.register.readData.expect(data)
    data
  }

  private def writeWhole(unit: RegisterFile.OfFrames, register: Register, bits: BigInt): Unit =
    for (word <- 0 until register.words) write(unit, register.address + word, (bits >> 32 * word) & 0xffffffffL)

  private def readWhole(unit: RegisterFile.OfFrames, register: Register): BigInt =
    (0 until register.words).map(word => read(unit, register.address + word) << 32 * word).sum

  private def ones(register: Register): BigInt = (BigInt(1) << register.width) - 1

  private def shown(unit: RegisterFile.OfFrames, register: Register): BigInt =
    LayoutSpec.number(unit.io.frame, register.name).peek().litValue & ones(register)

  inOneSimulation(RegisterFile.ofFrames(config))(
    "store every setting, clamp it for the hardware, and read it back" -> { unit =>
      val random = new Random(8)
      val values = settings.map(r => r -> BigInt(r.width, random))
      values.foreach { case (register, bits) => writeWhole(unit, register, bits) }
      for ((register, bits) <- values) withClue(s"${register.name}: ") {
        readWhole(unit, register) shouldBe bits
        if (!register.name.endsWith("Base")) shown(unit, register) shouldBe register.limit.fold(bits)(bits.min)
      }
    },
    "clamp registers above their limits only" -> { unit =>
      val limited = settings.filter(_.limit.nonEmpty)
      limited.map(_.name) should contain allOf (
        "shading.lights",
        "frame.unitShift",
        "camera.stepShift",
        "scene.recordCount"
      )
      for (register <- limited.sortBy(_.name != "scene.recordCount"); limit <- register.limit)
        withClue(s"${register.name}: ") {
          for (value <- Seq(limit - 1, limit + 1, ones(register), limit).filter(_ >= 0)) {
            writeWhole(unit, register, value)
            shown(unit, register) shouldBe value.min(limit)
            readWhole(unit, register) shouldBe value
          }
        }
    },
    "read status, errors and counters" -> { unit =>
      val random = new Random(9)
      for (register <- registers if register.access == Access.ReadOnly) withClue(s"${register.name}: ") {
        val bits = BigInt(register.width, random)
        LayoutSpec.number(unit.io.device, register.name) match {
          case flag: chisel3.Bool  => flag.poke(bits == 1)
          case count: chisel3.UInt => count.poke(bits)
          case other               => fail(s"a status of type $other")
        }
        readWhole(unit, register) shouldBe bits
      }
    },
    "start a frame by a write of 1, for one cycle" -> { unit =>
      val start = registers.find(_.name == "control.start").get.address
      unit.io.start.expect(false)
      unit.io.register.write.poke(true)
      unit.io.register.address.poke(start)
      unit.io.register.writeData.poke(0)
      unit.io.start.expect(false)
      unit.io.register.writeData.poke(1)
      unit.io.start.expect(true)
      unit.clock.step()
      unit.io.register.write.poke(false)
      unit.io.start.expect(false)
      unit.io.register.write.poke(true)
      unit.io.register.address.poke(start + 1)
      unit.io.start.expect(false)
    },
    "ignore every write while a frame runs" -> { unit =>
      val width = settings.find(_.name == "frame.width").get
      writeWhole(unit, width, 640)
      unit.io.device.status.busy.poke(true)
      writeWhole(unit, width, 320)
      readWhole(unit, width) shouldBe 640
      unit.io.register.write.poke(true)
      unit.io.register.address.poke(0)
      unit.io.register.writeData.poke(1)
      unit.io.start.expect(false)
    },
    "read 0 from unknown addresses and from write-only registers" -> { unit =>
      val size = RegisterMap.size(registers)
      read(unit, (1 << RegisterFile.addressBits(config)) - 1) shouldBe 0
      if (size < (1 << RegisterFile.addressBits(config))) read(unit, size) shouldBe 0
      read(unit, 0) shouldBe 0
    }
  )

  private val withInstances = ConfigIO.load("tiny", Seq("frame.instances=2"))

  inOneSimulation(RegisterFile.ofFrames(withInstances))(
    "read 0 after a reset from registers of instances, which have none" -> { unit =>
      val random    = new Random(10)
      val instances = RegisterMap(withInstances).filter(_.name.startsWith("instances["))
      val values    = instances.map(r => r -> (BigInt(r.width, random) | 1))
      values.foreach { case (register, bits) => writeWhole(unit, register, bits) }
      for ((register, bits) <- values) withClue(s"${register.name}: ")(readWhole(unit, register) shouldBe bits)
      unit.reset.asBool.poke(true)
      unit.clock.step()
      unit.reset.asBool.poke(false)
      for (register <- instances) withClue(s"${register.name}: ")(readWhole(unit, register) shouldBe 0)
      // A write brings back one word, not the others
      val (register, bits) = values.head
      writeWhole(unit, register, bits)
      readWhole(unit, register) shouldBe bits
      for (other <- instances.tail) withClue(s"${other.name}: ")(readWhole(unit, other) shouldBe 0)
    }
  )
}
