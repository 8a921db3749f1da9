package colonnade.environment

import chisel3._
import chisel3.util.Valid
import chiseltest._
import colonnade.{Simulation, TestConfigs}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{AlbedoEntry, Load, NormalEntry}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

private class MapHarness(config: ColonnadeConfig) extends Module {
  private val albedoMap  = Module(AttributeMap(config, "albedo", new AlbedoEntry, MapHarness.tagBits))
  private val normalsMap = Module(AttributeMap(config, "normals", new NormalEntry, MapHarness.tagBits))

  val load    = IO(Flipped(Valid(new Load(config))))
  val albedo  = FlatChannel(albedoMap.io.pixels)
  val normals = FlatChannel(normalsMap.io.pixels)
  albedoMap.io.load  := load
  normalsMap.io.load := load
}

private object MapHarness {
  val tagBits: Int = 5
}

/** Compares maps with the model.
  *
  * @param cycles  of a pixel, at most
  * @param latency of the first one
  */
abstract class AttributeMapSpec(map: String, environments: Seq[ColonnadeConfig], cycles: Int, latency: Int)
    extends AnyFlatSpec
    with ChiselScalatestTester {
  behavior of map

  for ((config, seed) <- environments.zipWithIndex) {
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
          val all = ChannelTester.run(maps.clock, testers)
          if (offered == 1) assert(all <= cycles * count + 8)
          testers.foreach(tester => assert(tester.latency == latency))
        }
      }
    }
  }
}

/** A pixel takes one cycle, or two where its tile has four entries. */
class TwoLevelMapSpec extends AttributeMapSpec("TwoLevelMap", TestConfigs.environments, cycles = 2, latency = 6)

class SlicMapSpec extends AttributeMapSpec("SlicMap", TestConfigs.slicEnvironments, cycles = 1, latency = 5)

private class PlaneMapHarness(config: ColonnadeConfig) extends Module {
  private val map = Module(new PlaneMap(config, PlaneMapHarness.tagBits))

  val load   = IO(Flipped(Valid(new Load(config))))
  val cells  = FlatChannel(map.io.cells)
  val planes = FlatChannel(map.io.planes)
  map.io.load := load
}

private object PlaneMapHarness {
  val tagBits: Int = 5
}

class PlaneMapSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "PlaneMap"

  for ((config, seed) <- TestConfigs.environments.zipWithIndex) {
    val size = config.physicalAttributeMemory.get
    it should s"give the model's tiles, cells and planes: ${size.width}x${size.height}, tiles of ${size.tileSize}" in {
      val random      = new Random(seed)
      val environment = new EnvironmentStimulus(config, random)
      test(new PlaneMapHarness(config)).withAnnotations(Simulation.verilator) { map =>
        environment.load(map.load, map.clock)
        for (offered <- Seq(1.0, 0.3)) {
          def tester(name: String, channel: FlatChannel, exchanges: Seq[Exchange]) =
            new ChannelTester(name, channel, PlaneMapHarness.tagBits, exchanges, offered, random)
          val (cells, planes) =
            (tester("cells", map.cells, environment.cells(500)), tester("planes", map.planes, environment.planes(400)))
          val cycles = ChannelTester.run(map.clock, Seq(cells, planes))
          // Two words a cell at most
          if (offered == 1) assert(cycles <= 2 * 500 + 8)
          assert((cells.latency, planes.latency) == ((5, 1)))
        }
      }
    }
  }
}
