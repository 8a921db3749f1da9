package colonnade.environment

import chisel3._
import chisel3.util.Valid
import chiseltest._
import colonnade.config.{ColonnadeConfig, PhysicalAttributeMemoryConfig, TextureLayout}
import colonnade.formats.{AlbedoEntry, AttributeMemories, Load}
import colonnade.{Packed, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

private class TextureHarness(config: ColonnadeConfig, columns: Int) extends Module {
  private val memory = Module(new TextureMemory(config, columns))

  val load = IO(Flipped(Valid(new Load(config))))
  memory.io.load := load

  /** By column, as channels whose tags have no bits. */
  val channels = memory.io.ports.map { port =>
    val pins = Wire(new AttributeChannel(new MapPixel(TextureLayout.of(config)), new AlbedoEntry, 0))
    port.req.valid           := pins.req.valid
    port.req.bits.x          := pins.req.bits.content.x
    port.req.bits.y          := pins.req.bits.content.y
    pins.req.ready           := port.req.ready
    pins.resp.valid          := port.resp.valid
    pins.resp.bits.tag       := 0.U
    pins.resp.bits.content   := port.resp.bits.colour
    pins.resp.bits.isIllegal := port.resp.bits.isIllegal
    FlatChannel(pins)
  }
}

class TextureMemorySpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "TextureMemory"

  private val config = TestConfigs.withTextures

  /** An environment whose albedo map is stored as the textures are. */
  private val asMap = {
    val layout = TextureLayout.of(config)
    val memory = PhysicalAttributeMemoryConfig(
      width = layout.mapWidth,
      height = layout.mapHeight,
      tileSize = 1 << layout.tileLog,
      paletteSize = layout.paletteSize,
      mapBytes = layout.bytes,
      planes = 16,
      planeBytes = 8192,
      boundingPlanes = 2,
      columnsPerCopy = 1
    )
    TestConfigs.tiny.copy(physicalAttributeMemory = Some(memory))
  }

  for (columns <- 1 to 3)
    it should s"give the texels of the model to columns, of $columns, also of tiles that point beyond the heap" in {
      val random = new Random(31)
      val image  = new EnvironmentImage(asMap, random, illegal = 0.3)
      val req    = new Packed(new MapPixel(TextureLayout.of(config)))
      val resp   = new Packed(new AlbedoEntry)
      test(new TextureHarness(config, columns)).withAnnotations(Simulation.verilator) { dut =>
        dut.clock.setTimeout(0)
        val words =
          AttributeMemories(config).map(memory => memory.name -> image.words(memory.name.replace("texture", "albedo")))
        EnvironmentImage.load(dut.load, dut.clock, config, words.toMap)
        val testers = dut.channels.zipWithIndex.map { case (channel, column) =>
          val pixels    = image.corners ++ Seq.fill(400)(image.pixel())
          val answers   = image.ask("albedo", pixels.map { case (x, y) => Seq(BigInt(x), BigInt(y)) })
          val exchanges = pixels.zip(answers).map { case ((x, y), values) =>
            val found = resp.pack(Seq("r", "g", "b").zip(values).toMap) | (values.last << resp.width)
            Exchange(req.pack(Map("x" -> x, "y" -> y)), found)
          }
          assert(answers.exists(_.last == 1) && answers.exists(_.last == 0))
          new ChannelTester(s"port $column", channel, tagBits = 0, exchanges, 0.7, random)
        }
        ChannelTester.run(dut.clock, testers)
      }
    }
}
