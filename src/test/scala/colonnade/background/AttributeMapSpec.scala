package colonnade.background

import chisel3._
import chisel3.util.Valid
import chiseltest._
import colonnade.TestConfigs
import colonnade.config.ColonnadeConfig
import colonnade.formats.{AlbedoEntry, Load, NormalEntry}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

private class MapHarness[T <: Data](config: ColonnadeConfig, name: String, entry: T) extends Module {
  private val map = Module(AttributeMap(config, name, entry, MapHarness.tagBits))

  val load   = IO(Flipped(Valid(new Load(config))))
  val pixels = FlatChannel(map.io.pixels)
  map.io.load := load
}

private object MapHarness {
  val tagBits: Int = 5
}

class AttributeMapSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "AttributeMap"

  private def check(config: ColonnadeConfig, name: String, entry: => Data, seed: Int)(
      dialogue: RoomDialogue => Seq[Exchange]
  ): Unit = {
    val random = new Random(seed)
    val room   = new RoomDialogue(config, random)
    test(new MapHarness(config, name, entry)).withAnnotations(Seq(VerilatorBackendAnnotation)) { map =>
      room.load(map.load, map.clock)
      for (offered <- Seq(1.0, 0.3)) {
        val exchanges = dialogue(room)
        val tester    = new ChannelTester(name, map.pixels, MapHarness.tagBits, exchanges, offered, random)
        val cycles    = ChannelTester.run(map.clock, Seq(tester))
        assert(tester.asked == exchanges.size)
        // Two cycles a pixel at most, and a few for the first answer.
        if (offered == 1) assert(cycles <= 2 * exchanges.size + 8)
      }
    }
  }

  for ((config, seed) <- TestConfigs.rooms.zipWithIndex; size = config.physicalAttributeMemory.get) {
    val which = s"maps of ${size.width}x${size.height} pixels in tiles of ${size.tileSize}, ${size.encoding.name}"
    it should s"answer as the model does, in order: albedo, $which" in
      check(config, "albedo", new AlbedoEntry, seed)(_.albedo(400))
    it should s"answer as the model does, in order: normals, $which" in
      check(config, "normals", new NormalEntry, seed)(_.normals(400))
  }
}
