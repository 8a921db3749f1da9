package colonnade.environment

import chisel3._
import chisel3.util.Valid
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.formats.Load
import colonnade.{Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

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
