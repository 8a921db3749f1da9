package colonnade.bus

import chiseltest.ChiselScalatestTester
import colonnade.config.ShellConfig
import colonnade.{Proofs, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

/** The rules of the bus, for all inputs. */
class ShellProofsSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  private val config = TestConfigs.tiny.copy(frame = TestConfigs.tiny.frame.copy(tileSize = 4, hits = false))

  behavior of "AxiWriteGuard"

  it should "end all bursts by AXI's rules, whenever the master is reset" in
    proveUntil(cycles = 9)(new AxiWriteGuardProof(4))

  behavior of "AxiReadGuard"

  it should "take all data, whenever the master is reset" in prove(new AxiReadGuardProof(4))

  behavior of "AxiWindow"

  it should "keep bursts in the window, and answer those that leave it" in prove(new AxiWindowProof(4))

  behavior of "BurstWriter"

  it should "write nothing outside the window, rows of less, as much and more than a beat" in
    proveUntil(cycles = 6)(new BurstWriterProof(config, ShellConfig(16)))

  behavior of "ImageLoader"

  it should "read nothing outside the window, whatever the image" in
    proveUntil(cycles = 8)(new ImageLoaderProof(config, ShellConfig(128)))
}
