package colonnade.bus

import chiseltest._
import colonnade.Simulation
import org.scalatest.flatspec.AnyFlatSpec

class SrgbEncoderSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "SrgbEncoder"

  for (cycles <- Seq(SrgbEncoder.latency, 2 * SrgbEncoder.latency))
    it should s"encode every linear value, rounded to nearest, in $cycles cycles" in {
      test(new SrgbEncoder(cycles = cycles)).withAnnotations(Simulation.verilator) { dut =>
        dut.enable.poke(true)
        for (linear <- 0 until 4096 + cycles) {
          dut.linear.poke(linear.min(4095))
          if (linear >= cycles) dut.code.expect(SrgbEncoder(linear - cycles))
          dut.clock.step()
        }
      }
    }

  it should "map black, white and the known middle grey" in {
    assert(Seq(0, 4095, 877).map(SrgbEncoder(_)) == Seq(0, 255, 128)) // 0.2140 is half of the codes
  }
}
