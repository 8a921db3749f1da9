package colonnade.environment

import chisel3._
import chisel3.util.Valid
import chiseltest._
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.{AlbedoEntry, Load, NormalEntry}
import colonnade.{Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

private class MapHarness(config: ColonnadeConfig) extends Module {
  private val layout     = AttributeLayout.of(config)
  private val albedoMap  = Module(new TwoLevelMap(config, layout, "albedo", new AlbedoEntry, MapHarness.tagBits))
  private val normalsMap = Module(new TwoLevelMap(config, layout, "normals", new NormalEntry, MapHarness.tagBits))

  val load    = IO(Flipped(Valid(new Load(config))))
  val albedo  = FlatChannel(albedoMap.io.pixels)
  val normals = FlatChannel(normalsMap.io.pixels)
  albedoMap.io.load  := load
  normalsMap.io.load := load
}

private object MapHarness {
  val tagBits: Int = 5
}

class TwoLevelMapSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "TwoLevelMap"

  for ((config, seed) <- TestConfigs.environments.zipWithIndex) {
    val size = config.physicalAttributeMemory.get
    it should s"respond like the model: ${size.width}x${size.height}, tiles of ${size.tileSize}" in {
      val count       = 600
      val random      = new Random(seed)
      val environment = new EnvironmentStimulus(config, random)
      test(new MapHarness(config)).withAnnotations(Simulation.verilator) { maps =>
        environment.load(maps.load, maps.clock)
        for (offered <- Seq(1.0, 0.3)) {
          def tester(name: String, channel: FlatChannel, exchanges: Seq[Exchange]) =
            new ChannelTester(name, channel, MapHarness.tagBits, exchanges, offered, random)
          val testers = Seq(
            tester("albedo", maps.albedo, environment.albedo(count)),
            tester("normals", maps.normals, environment.normals(count))
          )
          val cycles = ChannelTester.run(maps.clock, testers)
          // One cycle a pixel, or two where a tile has four entries; and the first one's latency
          if (offered == 1) assert(cycles <= 2 * count + 8)
          testers.foreach(tester => assert(tester.latency == 6))
        }
      }
    }
  }
}
