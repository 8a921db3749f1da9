package colonnade.bus

import chiseltest._
import colonnade.Simulation
import org.scalatest.flatspec.AnyFlatSpec

class SrgbEncoderSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "SrgbEncoder"

  it should "encode every linear value, rounded to nearest" in {
    test(new SrgbEncoder()).withAnnotations(Simulation.verilator) { dut =>
      dut.enable.poke(true)
      for (linear <- 0 until 4096 + SrgbEncoder.latency) {
        dut.linear.poke(linear.min(4095))
        if (linear >= SrgbEncoder.latency) dut.code.expect(SrgbEncoder(linear - SrgbEncoder.latency))
        dut.clock.step()
      }
    }
  }

  it should "map black, white and the known middle grey" in {
    assert(Seq(0, 4095, 877).map(SrgbEncoder(_)) == Seq(0, 255, 128)) // 0.2140 is half of the codes
  }
}
