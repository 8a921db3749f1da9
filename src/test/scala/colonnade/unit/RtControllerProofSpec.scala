package colonnade.unit

import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.{Always, Matrix, Proofs, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

class RtControllerProofSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "RtController"

  private val environment = TestConfigs.withEnvironment(TestConfigs.environment)

  private def config(contexts: Int, base: ColonnadeConfig): ColonnadeConfig =
    base.copy(units = base.units.copy(pathContexts = contexts))

  for (contexts <- Seq(2, 17))
    it should s"give each of $contexts paths to its stages, once and in order" taggedAs Matrix in
      prove(13)(new RtControllerProof(config(contexts, TestConfigs.tiny)))

  for ((contexts, cycles, tag) <- Seq((2, 9, Always), (2, 11, Matrix), (17, 10, Matrix)))
    it should s"give each of $contexts paths to its stages, with an environment, in $cycles cycles" taggedAs tag in
      prove(cycles)(new RtControllerProof(config(contexts, environment)))
}
